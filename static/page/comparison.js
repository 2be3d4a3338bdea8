// The frame against the render of the scan from its pose, in ways that belong to this browser and outlast a reload.
//
// The panel has one place for the pictures, and says of each frame in a hidden <div class="gazeloc-told"> where its
// pictures are. Which frame shows is scrub.js's. One frame's pictures are loaded at a time, small ones first, and then
// those of the frame that was asked for last: playing drops frames, and what is shown is always a frame with its own
// render and its own number.
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
  const PLACES = ["frame", "render", "other"];
  const AHEAD_MS = 400;
  const AHEAD = [1, 2, -1, 3]; // steps in the direction of the last move
  const choice = Object.assign({ mode: "wipe", wipe: 50, blend: 50, lens: false }, stored());
  const failed = new Map(); // by URL, why there is no picture
  let root, stage, said, gaze, overlay, names, number; // the page's own nodes
  let wanted, loading, shown, overtaken, ahead; // the frames that are to be shown next, on their way, and shown
  let turn = 0; // counts the times that what was on its way became outdated
  let direction = 1;

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
    number = make("div", { className: "gazeloc-number" });
    const edges = make("canvas", { className: "gazeloc-edges" });
    stage = make("div", { className: "gazeloc-stage" }, edges, overlay, gaze, number, said, ...names);
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
    if (lens !== choice.lens || (choice.mode === "two" && mode !== "two")) {
      turn++; // what is on its way is not what is wanted now
      show(wanted || shown);
    }
    if (choice.mode === "edges") drawEdges();
  }

  // The panel has made the place where the pictures are, or made it anew.
  function home(box) {
    if (!root) build();
    box.append(root);
  }

  // Pass on what the panel says of a frame.
  function take(box) {
    if (!box.isConnected) return; // a newer one has come already
    if (!root) build();
    window.gazelocScrub.take(saidBy(box));
  }

  // What a box says: one frame's number, gaze and overlay, and where to find the pictures of any frame.
  function saidBy(box) {
    const { number, last, show, frame, render, other, poses, otherPoses, names, none, marks, aspect, lensAspect, gaze, lensGaze } =
      box.dataset;
    const series = [show, frame, render, other, names, marks].join(" ");
    const common = { series, show, last: Number(last), names: names.split("|"), aspect, lensAspect, at };
    function at(number) {
      const url = (template, hex) => (template && (!hex || hasPose(hex, number)) ? template.replace("{}", number) : "");
      const pictures = { frame: url(frame), render: url(render, poses), other: url(other, otherPoses) };
      return { ...common, ...pictures, number, none: "", gaze: "", lensGaze: "", overlay: [] };
    }
    const overlay = [...box.querySelector(".gazeloc-overlay").children];
    return { ...at(Number(number)), none, gaze, lensGaze, overlay };
  }

  // Whether a frame's bit is set; the first of each digit's four is the highest.
  function hasPose(hex, number) {
    return (parseInt(hex[number >> 2] || "0", 16) >> (3 - (number & 3))) & 1;
  }

  // Show a frame: at once where its pictures are here, else when they come; of those asked for meanwhile the last.
  function show(what) {
    if (!what) return;
    if (!shown) stage.style.setProperty("--gazeloc-aspect", choice.lens ? what.lensAspect : what.aspect);
    if (loading && loading.turn === turn && isSame(loading, what)) {
      Object.assign(loading, what);
      if (shown === loading) describe(shown);
      wanted = undefined;
      return;
    }
    const here = urls(what).map((url) => url && pictures().ready(url));
    if (here.every((image) => image !== undefined)) {
      turn++;
      wanted = undefined;
      put(what, here);
    } else {
      wanted = what;
      if (!loading) work();
    }
    if (overtaken) overtaken();
  }

  async function work() {
    clearTimeout(ahead);
    while (wanted) {
      loading = { ...wanted, turn };
      wanted = undefined;
      await load(loading);
    }
    loading = undefined;
    ahead = setTimeout(lookAhead, AHEAD_MS);
  }

  async function load(what) {
    const of = urls(what), isWhole = of.every((url) => !url || pictures().ready(url));
    of.forEach((url) => failed.delete(url));
    if (!isWhole) {
      const quick = await Promise.all(of.map((url) => url && fetched(url, "quick")));
      if (what.turn === turn && quick.every((image) => image !== undefined)) put(what, quick, "quick");
      if (what.turn !== turn || wanted) return;
    }
    const newer = new Promise((done) => (overtaken = done));
    const there = of.map((url) => url && (failed.has(url) ? undefined : fetched(url))); // what failed would fail again
    const whole = await Promise.race([Promise.all(there), newer]);
    overtaken = undefined;
    if (what.turn === turn && whole) put(what, whole.map((image) => image || ""));
  }

  // The picture; undefined where there is none, and then `failed` says why.
  async function fetched(url, how) {
    const { image, why } = await pictures().load(url, how);
    if (why) failed.set(url, why);
    return image;
  }

  function urls(what) {
    const through = (url) => (url && choice.lens ? `${url}&lens=1` : url);
    return [what.frame, what.render, choice.mode === "two" ? what.other : ""].map(through);
  }

  function isSame(one, other) {
    return [...urls(one)].join() === [...urls(other)].join();
  }

  function pictures() {
    return window.gazelocPictures;
  }

  // Frame, render and B into the stage, as images or "" for none.
  function put(what, images, how = "whole") {
    if (shown && shown.number !== what.number) direction = Math.sign(what.number - shown.number);
    shown = what;
    PLACES.forEach((place, i) => putOne(place, images[i]));
    stage.dataset.quality = how;
    describe(what);
    if (choice.mode === "edges") drawEdges();
    stage.dataset.shown = what.number;
    clearTimeout(ahead);
    if (!loading) ahead = setTimeout(lookAhead, AHEAD_MS);
  }

  function putOne(place, image) {
    const before = stage.querySelector(`img.gazeloc-${place}`);
    if (image && image !== before) {
      if (image.parentNode === stage) image = image.cloneNode(); // A and B may be the same picture
      image.alt = place;
      image.className = `gazeloc-${place}`;
      if (before) before.replaceWith(image);
      else stage.insertBefore(image, stage.querySelector(place === "frame" ? "*" : ".gazeloc-edges"));
    } else if (!image && before) before.remove();
  }

  function describe(what) {
    const [frame, render, other] = PLACES.map((place) => stage.querySelector(`img.gazeloc-${place}`));
    stage.style.setProperty("--gazeloc-aspect", choice.lens ? what.lensAspect : what.aspect);
    const [x, y] = (choice.lens ? what.lensGaze : what.gaze).split(" ");
    gaze.hidden = !y;
    gaze.style.setProperty("--gazeloc-gaze-x", `${x}%`);
    gaze.style.setProperty("--gazeloc-gaze-y", `${y}%`);
    overlay.replaceChildren(...what.overlay);
    overlay.hidden = choice.lens; // keypoints are known in undistorted frames
    const [first, second] = what.names;
    names[0].textContent = `A ${first}${render ? "" : ": no pose"}`;
    names[1].textContent = `B ${second || "is chosen below"}${other || !second ? "" : ": no pose"}`;
    stage.toggleAttribute("data-none", !render);
    stage.toggleAttribute("data-none-other", !other);
    number.textContent = `frame ${what.number}`;
    const [frameUrl, renderUrl] = urls(what);
    if (!frame) said.textContent = failed.get(frameUrl) || "";
    else said.textContent = renderUrl ? (render ? "" : failed.get(renderUrl) || "") : what.none;
  }

  function drawEdges() {
    const image = stage.querySelector("img.gazeloc-render");
    if (image && image.naturalWidth) window.gazelocEdges.draw(image, stage.querySelector("canvas"));
  }

  // While nothing else is to be done, fetch the next frames in the direction of the last move, and the one before.
  async function lookAhead() {
    const at = shown;
    for (const step of AHEAD) {
      const next = at.number + step * direction;
      if (next < 0 || next > at.last) continue;
      for (const url of urls(at.at(next))) {
        if (!url || pictures().ready(url)) continue;
        await pictures().load(url, "ahead");
        if (loading || shown !== at) return;
      }
    }
  }

  return { home, take, show, choose };
})();
