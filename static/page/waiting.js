// Says when the server is gone, and comes back by itself: viser's page reconnects only while it has the focus.
(function waiting() {
  const EVERY_MS = 2000;
  const PATIENCE_MS = 5000; // viser's own reconnecting goes first
  const GONE =
    "GazeLoc does not answer: it was ended, or the network is down. " +
    "This page goes on by itself once it is back; every step that was shown is saved.";
  const REFUSED = "GazeLoc was started anew and no longer knows this browser: open the link that it printed.";
  let goneSince = null;

  function banner(text) {
    let box = document.getElementById("gazeloc-banner");
    if (!text) {
      if (box) box.remove();
      return;
    }
    if (!box) {
      box = document.createElement("div");
      box.id = "gazeloc-banner";
      box.setAttribute("role", "alert");
      document.body.append(box);
    }
    box.textContent = text;
  }

  async function look() {
    const answer = await window.gazeloc.ask("here");
    if (answer === "silent") banner(GONE);
    else banner(answer === "refused" ? REFUSED : "");
    if (answer !== "gone") goneSince = null;
    else if (goneSince === null) goneSince = Date.now();
    else if (Date.now() - goneSince > PATIENCE_MS) location.reload();
    setTimeout(look, EVERY_MS);
  }

  let begun = false;
  window.gazeloc.onHello(() => {
    goneSince = null;
    if (!begun) setTimeout(look, EVERY_MS);
    begun = true;
  });
})();
