// The window of the selected keypoint: on the scan and in frames, enlarged. A click in it moves the keypoint there.
// The server sends its boxes as hidden HTML in a panel (panels/loupe.py), here they get a place over the 3D view.
window.gazelocLoupe = (function loupe() {
  const KEY = "gazeloc-loupe-folded";
  const LEAST = 340;
  const BESIDE = 8; // between the window and the sides of the 3D view
  const EDGE = 14; // lens.css: the window's padding on both sides, and the gap between its boxes
  const GAP = 6;
  let dock;

  function build() {
    dock = document.createElement("div");
    dock.id = "gazeloc-loupe";
    dock.addEventListener("pointerdown", (event) => event.stopPropagation());
    dock.addEventListener("click", click);
    try {
      dock.toggleAttribute("data-folded", localStorage.getItem(KEY) === "1");
    } catch {} // a browser that keeps nothing opens it
    document.body.append(dock);
    setInterval(stand, 500); // panels are docked and widened without a word
  }

  // At the lower left of the 3D view, which lies between the panels.
  function stand() {
    const canvas = window.__viserMutable && window.__viserMutable.canvas;
    if (!canvas || !dock.childElementCount) return;
    const box = canvas.getBoundingClientRect();
    dock.style.left = `${Math.round(box.left) + BESIDE}px`;
    dock.style.maxWidth = `${Math.round(box.width) - 2 * BESIDE}px`;
    showWhole(box.width - 2 * BESIDE - EDGE);
    dock.toggleAttribute("data-narrow", box.width < LEAST); // it would hide what it belongs to
  }

  // Of the boxes as many as fit whole.
  function showWhole(width) {
    const boxes = dock.querySelector(".gazeloc-loupe-boxes");
    const step = boxes.firstElementChild ? boxes.firstElementChild.offsetWidth + GAP : 0;
    if (step <= GAP) return; // folded
    boxes.style.maxWidth = `${Math.max(1, Math.floor((width + GAP) / step)) * step - GAP}px`;
  }

  function pin(box) {
    if (!box.isConnected) return; // a newer one has come already
    if (!dock) build();
    const boxes = box.querySelector(".gazeloc-loupe-boxes");
    dock.hidden = !boxes;
    if (!boxes) {
      dock.replaceChildren();
      return;
    }
    const title = Object.assign(document.createElement("b"), { textContent: boxes.dataset.name });
    const hint = Object.assign(document.createElement("span"), { textContent: "click to move it" });
    const fold = Object.assign(document.createElement("button"), { type: "button", title: "Fold or unfold the loupe" });
    fold.dataset.fold = "";
    fold.textContent = dock.hasAttribute("data-folded") ? "▴" : "▾";
    const head = document.createElement("header");
    head.append(title, hint, fold);
    const shown = boxes.cloneNode(true);
    shown.hidden = false;
    dock.replaceChildren(head, shown);
    stand();
  }

  function click(event) {
    if (event.target.closest("[data-fold]")) {
      const isFolded = dock.toggleAttribute("data-folded");
      event.target.textContent = isFolded ? "▴" : "▾";
      try {
        localStorage.setItem(KEY, isFolded ? "1" : "0");
      } catch {} // forgotten with the page
      return;
    }
    const box = event.target.closest(".gazeloc-loupe-box");
    if (!box) return;
    const rect = box.getBoundingClientRect(), key = box.closest(".gazeloc-loupe-boxes").dataset.key;
    // The box shows a part of the picture: (left, top) is the picture's corner in the box, (wide, high) its size there.
    const [left, top, wide, high] = box.dataset.picture.split(" ").map(Number);
    const u = ((event.clientX + 0.5 - rect.left - left) / wide).toFixed(6);
    const v = ((event.clientY + 0.5 - rect.top - top) / high).toFixed(6);
    if (!(u >= 0 && u <= 1 && v >= 0 && v <= 1)) return;
    if (box.dataset.frame) window.gazeloc.ask("frame-click", { key, u, v, frame: box.dataset.frame });
    else window.gazeloc.ask("loupe-click", { key, u, v, at: box.dataset.at, from: box.dataset.from });
  }

  return { pin };
})();
