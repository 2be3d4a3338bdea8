// Clicks in the timeline and in lists of frames, told to the app by its route /show/<recording>/<frame>.
window.gazelocTimeline = (() => {
  const EVERY_MS = 60;
  let next, timer;

  // The last frame asked for is always gone to; of quick ones in between, one in 60 ms.
  function show(url) {
    next = url;
    if (timer) return;
    send();
    timer = setTimeout(() => {
      timer = undefined;
      if (next) show(next);
    }, EVERY_MS);
  }

  function send() {
    fetch(next).catch(() => {}); // the app is gone, which the viewer says by itself
    next = undefined;
  }

  function go(event) {
    const line = event.currentTarget, box = line.getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    show(line.dataset.show + Math.round(share * Number(line.dataset.last)));
  }

  return { show, go, drag: (event) => event.buttons === 1 && go(event) };
})();
