// Where the 3D view takes long to draw, it is drawn when somebody wants to see it. Without a graphics card the browser
// puts nothing else on the screen before it is through with the view.
// - While frames are gone through it waits: cameras and gaze follow once the hand rests, and now and then while it does
//   not. A view that is turned meanwhile is drawn at once.
// - viser draws every second anew what nobody has changed, in case that it missed a change. That would keep a processor
//   busy; here it takes a twentieth of the time.
window.gazelocView = (function letTheViewWait() {
  const SLOW_MS = 50; // two frames of the screen, and a bit
  const REST = 3; // times what a drawing takes
  const LEAST_REST_MS = 250;
  const MOST_REST_MS = 1000;
  const AT_LAST = 10; // times what a drawing takes: hands that never rest see the view follow then
  const SETTLING_MS = 300; // viser goes on drawing for that long after it was asked to
  const IDLE = 20; // times what a drawing takes, from one drawing to the next of what nobody has changed
  const MOST_IDLE_MS = 10000;
  let renderer = null;
  let request = () => {};
  let paceMs = 0; // from drawing to the second frame of the screen after it
  let movedAt = -Infinity;
  let askedAt = -Infinity;
  let drawnAt = -Infinity;
  let drawnFrom = "";
  let later = 0;

  // Somebody goes from frame to frame.
  function wait() {
    movedAt = performance.now();
  }

  // When the view is to be drawn, in ms of performance.now(), and what asks for it then.
  function due(camera) {
    if (paceMs < SLOW_MS || seenFrom(camera) !== drawnFrom) return [0];
    const restMs = Math.min(Math.max(REST * paceMs, LEAST_REST_MS), MOST_REST_MS);
    const hand = Math.min(movedAt + restMs, drawnAt + AT_LAST * paceMs);
    const isAsked = askedAt > drawnAt || askedAt + SETTLING_MS + paceMs > performance.now();
    const idle = isAsked ? 0 : drawnAt + Math.min(IDLE * paceMs, MOST_IDLE_MS);
    return hand > idle ? [hand, ask] : [idle, request];
  }

  function ask() {
    askedAt = performance.now();
    request();
  }

  function seenFrom(camera) {
    const { width, height } = renderer.domElement;
    return [width, height, ...camera.matrixWorld.elements, ...camera.projectionMatrix.elements].join();
  }

  function slowly(render) {
    return function (scene, camera) {
      const viewer = window.__viserMutable;
      const isView = scene === viewer.scene && camera === viewer.camera && !renderer.getRenderTarget();
      const [at, again] = isView ? due(camera) : [0];
      const ms = at - performance.now();
      if (ms > 0) {
        clearTimeout(later);
        later = setTimeout(again, ms);
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

  // viser sets `requestRender` when its view is there, and calls it by that name.
  function watch(viewer) {
    request = viewer.requestRender;
    Object.defineProperty(viewer, "requestRender", { get: () => ask, set: (its) => (request = its) });
  }

  (function begin() {
    const viewer = window.__viserMutable;
    const scene = viewer && viewer.scene;
    if (!scene || !Object.hasOwn(scene, "onBeforeRender")) {
      setTimeout(begin, 60); // true-colors.js sets its own hook first
      return;
    }
    const before = scene.onBeforeRender;
    scene.onBeforeRender = function (drawing, ...others) {
      if (!renderer) {
        renderer = drawing;
        renderer.render = slowly(renderer.render);
        watch(viewer);
      }
      before.call(this, drawing, ...others);
    };
  })();

  return { wait, paceMs: () => paceMs };
})();
