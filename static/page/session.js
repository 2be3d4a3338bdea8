// This tab's session: it keeps an id over reloads, tells the server who it is, and asks it for things.
// The server gives each connection a secret (visitors.py); requests that change something carry it.
window.gazeloc = (function session() {
  const TAB = "gazeloc-tab";
  const NAME = "gazeloc-name";
  const listeners = [];
  let secret = null;
  let start = null;

  // Storage may be forbidden by the browser's settings: then this tab is a new one at each reload.
  function kept(storage, key, value) {
    try {
      if (value !== undefined) window[storage].setItem(key, value);
      return window[storage].getItem(key) || "";
    } catch {
      return value || "";
    }
  }

  function newId() {
    return Array.from(crypto.getRandomValues(new Uint8Array(12)), (byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  const tab = kept("sessionStorage", TAB) || kept("sessionStorage", TAB, newId());

  // Resolves to "here", "gone" (the server does not know this connection), "refused" (it does not let this browser in)
  // or "silent" (nobody answers).
  async function ask(what, values = {}) {
    if (secret === null) return "gone";
    try {
      const answer = await fetch(`/session/${secret}/${what}?${new URLSearchParams(values)}`, { cache: "no-store" });
      return answer.ok ? await answer.text() : "refused";
    } catch {
      return "silent";
    }
  }

  // Called by the server's own HTML, after each connection.
  function hello(newSecret, newStart) {
    if (start !== null && start !== newStart) {
      location.reload(); // another run of GazeLoc, perhaps with other scripts
      return;
    }
    secret = newSecret;
    start = newStart;
    ask("hello", { tab, name: kept("localStorage", NAME) });
    for (const listener of listeners) listener();
  }

  function rename(name) {
    ask("name", { name: kept("localStorage", NAME, name) });
  }

  return { ask, hello, rename, tab, onHello: (listener) => listeners.push(listener) };
})();
