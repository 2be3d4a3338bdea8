// The frame against the render of the scan from its pose, in ways that belong to this browser and outlast a reload.
//
// The panel sends a new <div class="gazeloc-comparison"> for each frame, which holds URLs and no pictures. The stage with
// the pictures is one and the same node that moves into it. One frame's pictures are loaded at a time, and then those of
// the frame that was asked for last: playing drops frames, and what is shown is always a frame with its own render.
window.gazelocComparison = (() => {
  const MODES = [
    ["wipe", "Wipe", "Drag over the picture: the frame on the left, the render on the right."],
    ["blend", "Blend", "The render over the frame, as strong as the slider says."],
    ["flicker", "Flicker", "Frame and render in turns, three times a second: what jumps is off."],
    ["edges", "Edges", "The render's edges over the frame."],
    ["difference", "Difference", "Dark where both are alike, brightened."],
    ["beside", "Side by side", "The frame on the left, the render on the right."],
    ["two", "A | B", "Below the frame the renders of two methods or alignments; choose B below."],
  ];
  const KEY = "gazeloc-comparison";
  const AHEAD_MS = 400;
  const choice = Object.assign({ mode: "wipe", wipe: 50, blend: 50, lens: false }, stored());
  let root, stage, said, gaze, overlay, names, latest, wanted, isBusy, shown, ahead;

  function stored() {
    try {
      return JSON.parse(localStorage.getItem(KEY)) || {};
    } catch {
      return {};
    }
  }

  function make(tag, properties, ...children) {
    const node = Object.assign(document.createElement(tag), properties);
    node.append(...children);
    return node;
  }

  function build() {
    const buttons = MODES.map(([mode, text, title]) => {
      const button = make("button", { textContent: text, title, onclick: () => choose({ mode }) });
      button.dataset.mode = mode;
      button.setAttribute("role", "radio");
      return button;
    });
    const modes = make("div", { className: "gazeloc-modes" }, ...buttons);
    modes.setAttribute("role", "radiogroup");
    gaze = make("div", { className: "gazeloc-gaze", hidden: true });
    overlay = make("div", { className: "gazeloc-overlay" });
    said = make("div", { className: "gazeloc-said" });
    names = [0, 1].map(() => make("div", { className: "gazeloc-names" }));
    const edges = make("canvas", { className: "gazeloc-edges" });
    stage = make("div", { className: "gazeloc-stage" }, edges, overlay, gaze, said, ...names);
    stage.addEventListener("pointerdown", wipe);
    stage.addEventListener("pointermove", (event) => event.buttons === 1 && wipe(event));
    root = make("div", {}, modes, stage, slider("wipe", "Frame | render", "Wipe"), slider("blend", "Blend render", "Blend"));
    const lens = make("input", { type: "checkbox", checked: choice.lens, onchange: () => choose({ lens: lens.checked }) });
    const title = "Both pictures as the glasses recorded them, not undistorted. Tags are drawn only into undistorted frames.";
    root.append(make("label", { title }, lens, "Original lens"));
    choose({});
  }

  function slider(name, text, label) {
    const input = make("input", { type: "range", min: 0, max: 100, value: choice[name] });
    input.setAttribute("aria-label", label);
    input.oninput = () => choose({ [name]: Number(input.value) });
    const row = make("label", {}, make("span", { textContent: text }), input);
    row.dataset.mode = name;
    return row;
  }

  function wipe(event) {
    if (choice.mode !== "wipe") return;
    const box = stage.getBoundingClientRect();
    choose({ wipe: Math.round(Math.min(Math.max((100 * (event.clientX - box.left)) / box.width, 0), 100)) });
  }

  function choose(change) {
    const lens = choice.lens, mode = choice.mode;
    Object.assign(choice, change);
    if (!MODES.some(([known]) => known === choice.mode)) choice.mode = "wipe";
    try {
      localStorage.setItem(KEY, JSON.stringify(choice));
    } catch {} // a browser that keeps nothing forgets it with the page
    stage.dataset.mode = choice.mode;
    const style = document.documentElement.style;
    style.setProperty("--gazeloc-wipe", `${choice.wipe}%`);
    style.setProperty("--gazeloc-blend", String(choice.blend / 100));
    for (const button of root.querySelectorAll("button"))
      button.setAttribute("aria-checked", String(button.dataset.mode === choice.mode));
    for (const row of root.querySelectorAll("label[data-mode]")) {
      row.hidden = row.dataset.mode !== choice.mode;
      row.querySelector("input").value = choice[row.dataset.mode];
    }
    if (lens !== choice.lens || (choice.mode === "two" && mode !== "two")) show(latest);
    if (choice.mode === "edges") drawEdges();
  }

  // Move into the box that the panel has sent, and show what it names.
  function take(box) {
    if (!box.isConnected) return; // a newer one has come already
    if (!root) build();
    box.append(root);
    const share = Number(box.dataset.number) / Math.max(Number(box.dataset.last), 1);
    document.documentElement.style.setProperty("--gazeloc-frame", `${100 * share}%`);
    latest = { ...box.dataset, overlay: [...box.querySelector(".gazeloc-overlay").children] };
    show(latest);
  }

  function show(what) {
    if (!what) return;
    wanted = what;
    if (!isBusy) work();
  }

  async function work() {
    isBusy = true;
    clearTimeout(ahead);
    while (wanted) {
      const what = wanted;
      wanted = undefined;
      await load(what);
    }
    isBusy = false;
    ahead = setTimeout(lookAhead, AHEAD_MS);
  }

  function through(url) {
    return url && choice.lens ? `${url}&lens=1` : url;
  }

  async function load(what, tries = 3) {
    const urls = [what.frame, what.render, choice.mode === "two" ? what.other : ""].map(through);
    const [frame, render, other] = await Promise.all(urls.map(picture));
    const isMissing = (urls[0] && !frame) || (urls[1] && !render) || (urls[2] && !other);
    if (isMissing && !wanted && tries > 1) {
      await new Promise((done) => setTimeout(done, 250)); // another browser's frame came first: ask again
      return wanted ? undefined : load(what, tries - 1);
    }
    if (isMissing && wanted) return undefined;
    shown = what;
    put("frame", frame);
    put("render", render);
    put("other", other);
    describe(what, { frame, render, other });
    if (choice.mode === "edges") drawEdges();
    stage.dataset.shown = what.number;
    return undefined;
  }

  async function picture(url) {
    if (!url) return null;
    const image = new Image();
    image.src = url;
    try {
      await image.decode();
      return image;
    } catch {
      return null;
    }
  }

  function put(alt, image) {
    const before = stage.querySelector(`img.gazeloc-${alt}`);
    if (image) {
      image.alt = alt;
      image.className = `gazeloc-${alt}`;
      image.draggable = false;
    }
    if (before && image) before.replaceWith(image);
    else if (before) before.remove();
    else if (image) stage.insertBefore(image, stage.querySelector(alt === "frame" ? "*" : ".gazeloc-edges"));
  }

  function describe(what, { frame, render, other }) {
    stage.style.setProperty("--gazeloc-aspect", choice.lens ? what.lensAspect : what.aspect);
    const [x, y] = (choice.lens ? what.lensGaze : what.gaze).split(" ");
    gaze.hidden = !y;
    gaze.style.setProperty("--gazeloc-gaze-x", `${x}%`);
    gaze.style.setProperty("--gazeloc-gaze-y", `${y}%`);
    overlay.replaceChildren(...what.overlay);
    overlay.hidden = choice.lens; // keypoints are known in undistorted frames
    const [first, second] = what.names.split("|");
    names[0].textContent = `A ${first}${render ? "" : ": no pose"}`;
    names[1].textContent = `B ${second || "not chosen"}${other || !second ? "" : ": no pose"}`;
    stage.toggleAttribute("data-none", !render);
    stage.toggleAttribute("data-none-other", !other);
    if (!frame) said.textContent = "the frame could not be read";
    else if (!what.render) said.textContent = choice.mode === "two" ? "" : "no pose, so no render";
    else said.textContent = render ? "" : "the render could not be drawn";
  }

  // Where the render's brightness changes most, in a colour that rooms seldom have.
  function drawEdges() {
    const image = stage.querySelector("img.gazeloc-render"), canvas = stage.querySelector("canvas");
    if (!image || !image.naturalWidth) return;
    const width = Math.min(image.naturalWidth, 700), height = Math.round((width * image.naturalHeight) / image.naturalWidth);
    canvas.width = width;
    canvas.height = height;
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    pen.filter = "blur(0.8px)";
    pen.drawImage(image, 0, 0, width, height);
    const pixels = pen.getImageData(0, 0, width, height), data = pixels.data;
    const grey = new Float32Array(width * height), steep = new Float32Array(width * height);
    for (let i = 0; i < grey.length; i++) grey[i] = 0.3 * data[4 * i] + 0.6 * data[4 * i + 1] + 0.1 * data[4 * i + 2];
    const counts = new Uint32Array(512);
    for (let y = 1; y < height - 1; y++)
      for (let i = y * width + 1; i < (y + 1) * width - 1; i++) {
        steep[i] = Math.hypot(grey[i + 1] - grey[i - 1], grey[i + width] - grey[i - width]);
        counts[Math.min(steep[i] | 0, 511)]++;
      }
    let limit = 511;
    for (let sum = 0; limit > 6 && sum < 0.07 * grey.length; limit--) sum += counts[limit];
    for (let i = 0; i < grey.length; i++) {
      data.set([255, 0, 200, steep[i] > limit ? 230 : 0], 4 * i);
    }
    pen.putImageData(pixels, 0, 0);
  }

  // While nothing else is to be done, have the neighbours' pictures ready in the browser's cache.
  async function lookAhead() {
    const at = shown;
    for (const item of at && at.posed ? at.posed.split(" ") : []) {
      const [number, hasPose] = item.split(":");
      const swap = (url) => through(url.replace(/\d+\.jpg/, `${number}.jpg`));
      await picture(swap(at.frame));
      if (isBusy || shown !== at) return;
      if (hasPose === "1" && at.render) await picture(swap(at.render));
      if (isBusy || shown !== at) return;
    }
  }

  return { take, choose };
})();
