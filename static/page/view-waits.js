// While frames are gone through, the 3D view waits where it takes long to draw: without a graphics card the browser puts
// no picture on the screen before it is through with the view. Cameras and gaze follow once the hand rests, and now and
// then while it does not. A view that is turned meanwhile is drawn at once.
window.gazelocView = (function letTheViewWait() {
  const SLOW_MS = 50; // two frames of the screen, and a bit
  const REST = 3; // times what a drawing takes
  const LEAST_REST_MS = 250;
  const MOST_REST_MS = 1000;
  const AT_LAST = 10; // times what a drawing takes: hands that never rest see the view follow then
  let renderer = null;
  let paceMs = 0; // from drawing to the second frame of the screen after it
  let movedAt = -Infinity;
  let drawnAt = -Infinity;
  let drawnFrom = "";
  let later = 0;

  // Somebody goes from frame to frame.
  function wait() {
    movedAt = performance.now();
  }

  function restMs() {
    return paceMs < SLOW_MS ? 0 : Math.min(Math.max(REST * paceMs, LEAST_REST_MS), MOST_REST_MS);
  }

  // For how long the view is not to be drawn yet, in ms.
  function waitingMs(camera) {
    const now = performance.now();
    if (seenFrom(camera) !== drawnFrom) return 0;
    return Math.min(movedAt + restMs(), drawnAt + AT_LAST * paceMs) - now;
  }

  function seenFrom(camera) {
    const { width, height } = renderer.domElement;
    return [width, height, ...camera.matrixWorld.elements, ...camera.projectionMatrix.elements].join();
  }

  function slowly(render) {
    return function (scene, camera) {
      const viewer = window.__viserMutable;
      const isView = scene === viewer.scene && camera === viewer.camera && !renderer.getRenderTarget();
      const ms = isView ? waitingMs(camera) : 0;
      if (ms > 0) {
        clearTimeout(later);
        later = setTimeout(viewer.requestRender, ms);
        return;
      }
      render.call(this, scene, camera);
      if (isView) measure(camera);
    };
  }

  function measure(camera) {
    const start = performance.now();
    drawnAt = start;
    drawnFrom = seenFrom(camera);
    requestAnimationFrame(() => requestAnimationFrame(() => took(performance.now() - start)));
  }

  // A page that was hidden meanwhile tells nothing: no drawing is taken for slower than the longest rest.
  function took(ms) {
    paceMs += (Math.min(ms, MOST_REST_MS) - paceMs) / 2;
  }

  (function begin() {
    const scene = window.__viserMutable && window.__viserMutable.scene;
    if (!scene || !Object.hasOwn(scene, "onBeforeRender")) {
      setTimeout(begin, 60); // true-colors.js sets its own hook first
      return;
    }
    const before = scene.onBeforeRender;
    scene.onBeforeRender = function (drawing, ...others) {
      if (!renderer) {
        renderer = drawing;
        renderer.render = slowly(renderer.render);
      }
      before.call(this, drawing, ...others);
    };
  })();

  return { wait, paceMs: () => paceMs };
})();
