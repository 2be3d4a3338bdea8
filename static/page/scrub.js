// Going through the frames. All browsers show the server's frame; the page that asked for one does not wait for it.
//
// A slider's move shows the frame at once, from what the server said of the last one, and asks the server to go there.
// What the server then says counts, but for what it said before it heard of the last move: that would jump back.
window.gazelocScrub = (() => {
  const PATIENCE_MS = 800; // then the server's frame shows: somebody else went on, or our question was lost
  const KNOWN = 500;
  const known = new Map();
  let told, asked, patience, isSending, next;

  // The server says what is to be shown (comparison.js made it from its HTML).
  function take(what) {
    if (!told || told.series !== what.series) known.clear();
    known.delete(what.number);
    known.set(what.number, what);
    if (known.size > KNOWN) known.delete(known.keys().next().value);
    told = what;
    const isOlder = asked && asked.show === what.show && asked.number !== what.number;
    if (!isOlder) giveIn();
    else mark();
  }

  // Show what the server said last.
  function giveIn() {
    clearTimeout(patience);
    asked = undefined;
    place(told.number);
    mark();
    window.gazelocComparison.show(told);
  }

  function go(number) {
    if (!told || !Number.isFinite(number)) return;
    number = Math.min(Math.max(Math.round(number), 0), told.last);
    asked = { number, show: told.show };
    window.gazelocView.wait();
    clearTimeout(patience);
    patience = setTimeout(giveIn, PATIENCE_MS);
    place(number);
    mark();
    send(`${told.show}${number}`);
    window.gazelocComparison.show(known.get(number) || told.at(number));
  }

  // Of quick moves the last one is always told; in between, one at a time.
  async function send(url) {
    next = url;
    if (isSending) return;
    isSending = true;
    while (next) {
      const now = next;
      next = undefined;
      await fetch(now, { cache: "no-store" }).catch(() => {}); // the app is gone, which waiting.js says
    }
    isSending = false;
  }

  // What is written about a frame is the server's: pale while another one shows.
  function mark() {
    document.documentElement.toggleAttribute("data-gazeloc-ahead", !!asked && asked.number !== told.number);
  }

  function place(number) {
    const line = document.querySelector(".gazeloc-timeline");
    if (line) line.style.setProperty("--gazeloc-frame", `${(100 * number) / Math.max(told.last, 1)}%`);
    const box = document.querySelector(".gazeloc-scrub");
    if (!box) return;
    const [slider, field] = box.querySelectorAll("input");
    slider.value = number;
    if (!field.dataset.typing) field.value = number;
  }

  // The panel has drawn slider, field or timeline, or drawn them anew.
  function ready() {
    if (told) place(asked ? asked.number : told.number);
  }

  function typed(field) {
    delete field.dataset.typing;
    if (field.value === "") place(told.number);
    else go(Number(field.value));
    field.value = asked ? asked.number : told.number;
    field.blur(); // keys are the viewer's again
  }

  return { take, go, ready, typed };
})();
