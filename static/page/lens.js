// The lens: what is around the pointer, enlarged, wherever a click sets a point. In the 3D view that is while Shift is
// held or a tool that aims is in hand (the server's <div id="gazeloc-tool" data-aims>), in the panel's frame with Shift.
// It is there too while a marker is dragged in the 3D view, which viser keeps still meanwhile.
// It copies pixels that the page has already: those of the drawn view, or of the frame's own picture, which has more
// than the panel shows.
window.gazelocLens = (function lens() {
  const SIZE = 184;
  const TIMES = 5;
  const BESIDE = 22;
  const AGAIN_MS = 120; // the view below may be drawn anew while the pointer rests
  const at = { x: 0, y: 0, target: null, buttons: 0 };
  let glass, isShifted = false, isHeld = false, timer = 0, isAsked = false;

  function view() {
    const canvas = window.__viserMutable && window.__viserMutable.canvas;
    return canvas && canvas.isConnected ? canvas : null;
  }

  function aims() {
    return isShifted || !!document.querySelector("#gazeloc-tool[data-aims]");
  }

  function drags() {
    const pointer = window.__viserPointer;
    return at.buttons === 1 && !!pointer && pointer.cameraLockReasons().length > 0;
  }

  // The frame's picture in the panel under a place of the page, with its rectangle; null beside it.
  function frameAt(x, y, target) {
    const stage = target instanceof Element ? target.closest(".gazeloc-stage") : null;
    const image = stage && stage.querySelector("img.gazeloc-frame");
    if (!image || !image.naturalWidth) return null;
    const box = image.getBoundingClientRect();
    const isIn = x >= box.left && x < box.right && y >= box.top && y < box.bottom;
    return isIn ? { stage, image, box } : null;
  }

  function look() {
    isAsked = false;
    for (const stage of document.querySelectorAll(".gazeloc-stage[data-aiming]")) delete stage.dataset.aiming;
    const frame = (isShifted || isHeld) && frameAt(at.x, at.y, at.target);
    if (frame) {
      frame.stage.dataset.aiming = "";
      show(frame.image, frame.box, frame.image.naturalWidth);
      return;
    }
    const canvas = view();
    const isOver = canvas && at.target === canvas;
    if (isOver && (drags() || (aims() && at.buttons === 0))) show(canvas, canvas.getBoundingClientRect(), canvas.width);
    else hide();
  }

  function hide() {
    clearTimeout(timer);
    if (glass) glass.hidden = true;
  }

  function show(source, box, width) {
    if (!glass) {
      glass = Object.assign(document.createElement("canvas"), { id: "gazeloc-lens" });
      document.body.append(glass);
    }
    const sharp = window.devicePixelRatio || 1;
    glass.hidden = false;
    glass.width = glass.height = Math.round(SIZE * sharp);
    const right = at.x + BESIDE + SIZE < innerWidth, below = at.y + BESIDE + SIZE < innerHeight;
    glass.style.left = `${right ? at.x + BESIDE : at.x - BESIDE - SIZE}px`;
    glass.style.top = `${below ? at.y + BESIDE : at.y - BESIDE - SIZE}px`;
    const pen = glass.getContext("2d"), scale = width / box.width, reach = (SIZE / TIMES) * scale;
    const middle = [(at.x + 0.5 - box.left) * scale, (at.y + 0.5 - box.top) * scale]; // viser clicks a pixel's middle
    pen.fillStyle = color("dark");
    pen.fillRect(0, 0, glass.width, glass.height);
    pen.imageSmoothingEnabled = TIMES / scale < 4;
    pen.drawImage(source, middle[0] - reach / 2, middle[1] - reach / 2, reach, reach, 0, 0, glass.width, glass.height);
    cross(pen, glass.width);
    clearTimeout(timer);
    timer = setTimeout(ask, AGAIN_MS);
  }

  // One of the app's colours (palette.py), which a canvas cannot look up by itself.
  function color(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(`--gazeloc-${name}`);
  }

  function cross(pen, size) {
    for (const [stroke, width] of [[color("light"), 3], [color("aim"), 1.2]]) {
      pen.strokeStyle = stroke;
      pen.lineWidth = (width * size) / SIZE;
      pen.beginPath();
      for (const [from, to] of [[0.3, 0.46], [0.54, 0.7]]) {
        pen.moveTo(from * size, size / 2);
        pen.lineTo(to * size, size / 2);
        pen.moveTo(size / 2, from * size);
        pen.lineTo(size / 2, to * size);
      }
      pen.stroke();
    }
  }

  function ask() {
    if (isAsked) return;
    isAsked = true;
    requestAnimationFrame(look);
  }

  function note(event) {
    Object.assign(at, { x: event.clientX, y: event.clientY, target: event.target, buttons: event.buttons });
    isShifted = event.shiftKey;
    if (isShifted || aims() || drags() || (glass && !glass.hidden)) ask();
  }

  for (const kind of ["pointermove", "pointerdown", "pointerup"]) addEventListener(kind, note, true);
  for (const kind of ["keydown", "keyup"])
    addEventListener(
      kind,
      (event) => {
        if (event.key !== "Shift") return;
        isShifted = kind === "keydown";
        ask();
      },
      true,
    );
  addEventListener("blur", () => {
    isShifted = false;
    hide();
  });
  document.documentElement.addEventListener("pointerleave", hide);

  // While a click in a frame is dragged the lens stays, Shift or not.
  function hold(on) {
    isHeld = on;
    ask();
  }

  return { frameAt, hold };
})();
