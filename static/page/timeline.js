// Clicks in the timeline and in lists of frames.
window.gazelocTimeline = (() => {
  function show(url) {
    window.gazelocScrub.go(Number(url.slice(url.lastIndexOf("/") + 1)));
  }

  function go(event) {
    const line = event.currentTarget, box = line.getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    window.gazelocScrub.go(share * Number(line.dataset.last));
  }

  return { show, go, drag: (event) => event.buttons === 1 && go(event) };
})();
