// Arrow keys move the selected keypoint and nothing else: viser would turn the view with them as well.
// While none is selected they turn the view, as always.
(function arrows() {
  const KEYS = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"];
  const THEIRS = "input, textarea, select, [contenteditable], [role=slider], [role=tab], [role=listbox], [role=combobox]";
  let last = Promise.resolve();

  function isSelected() {
    const dock = document.getElementById("gazeloc-loupe");
    return !!dock && !dock.hidden && dock.childElementCount > 0;
  }

  function press(event) {
    const isOurs = KEYS.includes(event.key) && !event.ctrlKey && !event.altKey && !event.metaKey;
    if (!isOurs || !isSelected() || (event.target instanceof Element && event.target.closest(THEIRS))) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    const what = { key: event.key.toLowerCase(), shift: event.shiftKey ? "1" : "0" };
    last = last.then(() => window.gazeloc.ask("arrow", what)); // one after the other, as they were pressed
  }

  addEventListener("keydown", press, true);
})();
