// When the page opens, the room is drawn first and the panels are filled then: React takes longer for two hundred widgets
// than the viewer for half a million triangles. What viser's worker hands over for panels is kept back, in its order,
// until all that came of the scene was drawn once, for LONGEST_MS at most. After a lost connection nothing is kept back.
// On a busy machine viser may by then stand at a place of its own: a view that neither a hand nor the app has moved is
// put where it is to start.
window.gazelocScene = (function sceneFirst() {
  const LONGEST_MS = 4000;
  const AT_LAST_MS = 15000; // since the page was loaded: should viser's worker speak another language, nothing waits for it
  const LOOK_MS = 30;
  const LARGE = new Set(["GlbMessage", "PointCloudMessage"]); // nodes that take a while from message to screen
  const FOR_PANELS = /^(Gui(?!3D|Panel|SetPanel)|RegisterCommand|UpdateCommand|RemoveCommand|RunJavascript|ReplayDone)/;
  const awaited = new Set();
  let held = [];
  let handOver = null;
  let connections = 0;
  let isHolding = true;
  let hasAll = false;
  let isMoved = false;

  function take(data, pass) {
    if (data.type === "connected") {
      connections += 1;
      if (connections > 1) forget(); // all of it is sent again
    }
    if (data.type !== "message_batch" || !isHolding) {
      pass(data);
      return;
    }
    if (!handOver) setTimeout(release, LONGEST_MS);
    handOver = pass;
    const now = [];
    const had = hasAll;
    for (const message of data.messages) {
      (isForPanels(message) ? held : now).push(message);
      if (LARGE.has(message.type)) awaited.add(message.name);
      if (message.type.startsWith("SetCamera") && !message.initial) isMoved = true;
      if (message.type === "ReplayDoneMessage") hasAll = true;
    }
    if (now.length) pass({ type: "message_batch", messages: now });
    if (hasAll && !had) watch();
  }

  // The viewer draws only when asked to: the frame that shows all is asked for here.
  function watch() {
    if (!isHolding) return;
    if (isComplete() && window.__viserMutable) window.__viserMutable.requestRender();
    setTimeout(watch, LOOK_MS);
  }

  // The server's hello (visitors.py) does not wait: it brings back the camera of the last visit.
  function isForPanels(message) {
    const content = (message.props && message.props.content) || "";
    return FOR_PANELS.test(message.type) && !(typeof content === "string" && content.includes("gazeloc.hello("));
  }

  function forget() {
    held = [];
    isHolding = false;
  }

  // Whether the page has all that was sent of the scene, so that the next frame shows it.
  function isComplete() {
    if (!isHolding) return true;
    const nodes = (window.__viserMutable && window.__viserMutable.nodeRefFromName) || {};
    return hasAll && [...awaited].every((name) => nodes[name]);
  }

  function standAtTheStart() {
    const viewer = window.__viserMutable;
    if (!isMoved && viewer && viewer.cameraControl && viewer.resetCameraPose) viewer.resetCameraPose(false);
  }

  function release() {
    if (!isHolding) return;
    const messages = held;
    forget();
    standAtTheStart();
    if (handOver && messages.length) handOver({ type: "message_batch", messages });
  }

  window.Worker = class extends window.Worker {
    set onmessage(listener) {
      super.onmessage = (event) => take(event.data || {}, (data) => listener.call(this, data === event.data ? event : { data }));
    }
    get onmessage() {
      return super.onmessage;
    }
  };

  // A notice that is closed, a button that is pressed move nothing.
  function isOfTheView(event) {
    const viewer = window.__viserMutable;
    return event.type === "keydown" ? event.target === document.body : !!viewer && event.target === viewer.canvas;
  }

  for (const kind of ["pointerdown", "wheel", "keydown"])
    addEventListener(kind, (event) => (isMoved ||= isOfTheView(event)), { capture: true, passive: true });
  setTimeout(release, AT_LAST_MS);
  return { isComplete, isReleased: () => !isHolding, release };
})();
