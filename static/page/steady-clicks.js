// A list of ours is made anew when something in it changes. The browser forgets a click whose element went away between
// press and release: then what stands for the same thing is clicked instead, wherever it is now.
(function steadyClicks() {
  const REACH_PX = 6; // farther is no click
  let pressed = null;

  function clickable(target) {
    return target instanceof Element ? target.closest(".gazeloc-box [onclick]") : null;
  }

  // What a click does: the same text does the same.
  function meaning(element) {
    return `${element.getAttribute("onclick")} ${element.dataset.url || ""}`;
  }

  function press(event) {
    const element = event.button === 0 ? clickable(event.target) : null;
    pressed = element && { element, meaning: meaning(element), x: event.clientX, y: event.clientY };
  }

  function release(event) {
    const last = pressed;
    pressed = null;
    if (!last || last.element.isConnected) return; // the browser makes the click itself
    if (Math.hypot(event.clientX - last.x, event.clientY - last.y) > REACH_PX) return;
    const all = Array.from(document.querySelectorAll(".gazeloc-box [onclick]"));
    const same = all.find((element) => meaning(element) === last.meaning);
    if (same) same.click();
  }

  addEventListener("pointerdown", press, true);
  addEventListener("pointerup", release, true);
  addEventListener("pointercancel", () => (pressed = null), true);
})();
