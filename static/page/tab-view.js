// The panels' open tabs, which only the page knows, kept for its browser tab over reloads.
(function tabView() {
  const KEY = "gazeloc-open-tabs";
  const TRIES = 100;

  function load() {
    try {
      return JSON.parse(sessionStorage.getItem(KEY)) || [];
    } catch {
      return [];
    }
  }

  function save() {
    const open = Array.from(document.querySelectorAll("[role=tab][aria-selected=true]"), (tab) => tab.textContent);
    if (!open.length) return;
    try {
      sessionStorage.setItem(KEY, JSON.stringify(open));
    } catch {
      // no storage: the next load begins anew
    }
  }

  // The panels' tabs listen to the pointer and to keys, not to clicks.
  function openTab(name, tries) {
    const tab = Array.from(document.querySelectorAll("[role=tab]")).find((one) => one.textContent === name);
    if (!tab) {
      if (tries > 0) setTimeout(() => openTab(name, tries - 1), 100);
    } else if (tab.getAttribute("aria-selected") !== "true") {
      tab.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
    }
  }

  function saveAfterTab(event) {
    if (event.isTrusted && event.target instanceof Element && event.target.closest("[role=tab]")) setTimeout(save, 300);
  }

  for (const kind of ["pointerup", "keyup"]) addEventListener(kind, saveAfterTab, true);
  window.gazeloc.onHello(() => load().forEach((name) => openTab(name, TRIES)));
})();
