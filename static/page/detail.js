// While the view moves and a frame takes long, a tenth of the lines and points is drawn; all again when it rests.
// While the page loads there are none, so that what is still to come does not wait for frames that nobody looks at.
// The server sends both in a shuffled order, so that any first part of them is spread evenly.
(function spareDetail() {
  const viewer = window.__viserMutable;
  const scene = viewer && viewer.scene;
  if (!scene || !Object.hasOwn(scene, "onBeforeRender")) {
    setTimeout(spareDetail, 60); // true-colors.js sets its own hook first
    return;
  }
  const SLOW_MS = 90;
  const FAST_MS = 20;
  const REST_MS = 250;
  const PAUSE_MS = 6000; // the slowest machines take seconds for a frame
  const SHARE = 0.1;
  const before = scene.onBeforeRender;
  let seen = "";
  let movedAt = 0;
  let slow = 0;
  let pace = 0;
  let rest = 0;
  let isLoading = true;

  function draw(share) {
    for (const [name, node] of Object.entries(viewer.nodeRefFromName)) {
      if (!node || !(name.startsWith("/frusta/") || name === "/sfm/cloud")) continue;
      node.traverse((part) => {
        if (!part.isLineSegments && !part.isPoints) return;
        const geometry = part.geometry;
        const source = geometry.index || geometry.attributes.position;
        if (!source) return;
        geometry.setDrawRange(0, share < 1 ? 2 * Math.floor((source.count * share) / 2) : Infinity);
      });
    }
  }

  function settle() {
    draw(1);
    viewer.requestRender();
  }

  scene.onBeforeRender = function (renderer, drawn, camera, ...others) {
    before.call(this, renderer, drawn, camera, ...others);
    const now = performance.now();
    const view = camera.matrixWorld.elements.join(); // a resized window is no movement
    const moves = view !== seen && seen !== "";
    seen = view;
    if (isLoading) {
      isLoading = !window.gazelocScene.isComplete();
      draw(isLoading ? 0 : 1);
      if (!isLoading) setTimeout(window.gazelocScene.release, 0); // once this frame is on its way
      return;
    }
    if (!moves) return;
    const since = now - movedAt; // frames without movement lie between, and tell nothing
    movedAt = now;
    if (since < PAUSE_MS) {
      slow = since > SLOW_MS ? slow + 1 : since < FAST_MS ? 0 : slow;
      pace = since;
    }
    if (slow < 2) return;
    draw(SHARE);
    clearTimeout(rest);
    rest = setTimeout(settle, Math.min(Math.max(REST_MS, 1.5 * pace), PAUSE_MS)); // not between two slow frames
  };
})();
