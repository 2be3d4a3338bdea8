// What only the page knows of its view, kept for its browser tab over reloads: the panels' open tabs, wipe and blend.
(function tabView() {
  const KEY = "gazeloc-view";
  const TRIES = 100;

  function load() {
    try {
      return JSON.parse(sessionStorage.getItem(KEY)) || {};
    } catch {
      return {};
    }
  }

  // The comparison keeps its sliders in variables named --gazeloc-… of the page's style, and in window.gazeloc….
  function save() {
    const style = document.documentElement.style;
    const names = Array.from(style).filter((name) => name.startsWith("--gazeloc-"));
    const values = Object.keys(window).filter((key) => /^gazeloc[A-Z]/.test(key) && typeof window[key] !== "object");
    const open = Array.from(document.querySelectorAll("[role=tab][aria-selected=true]"), (tab) => tab.textContent);
    const view = {
      tabs: open.length ? open : load().tabs,
      style: Object.fromEntries(names.map((name) => [name, style.getPropertyValue(name)])),
      values: Object.fromEntries(values.map((key) => [key, window[key]])),
    };
    try {
      sessionStorage.setItem(KEY, JSON.stringify(view));
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

  const before = load();
  for (const [name, value] of Object.entries(before.style || {})) document.documentElement.style.setProperty(name, value);
  Object.assign(window, before.values || {});
  addEventListener("pagehide", save);
  for (const kind of ["pointerup", "keyup"]) addEventListener(kind, saveAfterTab, true);
  window.gazeloc.onHello(() => {
    for (const name of load().tabs || []) openTab(name, TRIES);
  });
})();
