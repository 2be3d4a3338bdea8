// Pictures by URL. Those that were seen last stay here, so that going back to a frame asks nobody.
//
// A picture is put into the page when it is loaded, and never through `decode()`: that waits for the compositor, which
// a large scene drawn in software holds up for a second. `decoding = "sync"` has it painted with the frame it is put in.
window.gazelocPictures = (() => {
  const KEPT = 400; // a hundred frames, quick and in full, each with its render: some 25 MB as JPEG
  const TRIES = 3;
  const AGAIN_MS = 150;
  const kept = new Map();

  function asked(url, how) {
    const tab = window.gazeloc.tab;
    return `${url}&page=${tab}${how === "now" ? "" : `&${how}=1`}`;
  }

  // The picture in full where it is here already.
  function ready(url) {
    const image = kept.get(url);
    return image && image.complete && image.naturalWidth ? keep(url, image) : undefined;
  }

  function keep(key, image) {
    kept.delete(key);
    kept.set(key, image); // the last one used is the last to go
    while (kept.size > KEPT) kept.delete(kept.keys().next().value);
    return image;
  }

  // Resolves to {image}, or to {why}, a sentence. `how`: "now", "quick" for a small one, "ahead" for later use.
  async function load(url, how = "now") {
    for (let tries = TRIES; tries > 0; tries--) {
      const image = await attempt(url, how);
      if (image) return { image };
      const why = await reason(asked(url, how));
      if (why) return { why };
      await new Promise((done) => setTimeout(done, AGAIN_MS)); // another page's picture came first
    }
    return { why: "The picture did not come; go to another frame and back." };
  }

  function attempt(url, how) {
    const key = how === "quick" ? `quick ${url}` : url;
    const image = keep(key, kept.get(key) || Object.assign(new Image(), { decoding: "sync", draggable: false }));
    return new Promise((done) => {
      image.addEventListener("load", () => done(image), { once: true });
      image.addEventListener("error", () => done(kept.delete(key) && undefined), { once: true });
      if (!image.src) image.src = asked(url, how);
      else if (image.complete) done(image.naturalWidth ? image : kept.delete(key) && undefined);
    });
  }

  // Why there is no picture: the server's own sentence; "" where it may come when it is asked for again.
  async function reason(url) {
    try {
      const answer = await fetch(url);
      return answer.ok ? "" : (await answer.text()) || "The picture cannot be made.";
    } catch {
      return "GazeLoc does not answer.";
    }
  }

  return { ready, load };
})();
