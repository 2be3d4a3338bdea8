// Clicks in the panel's frame: with Shift they set a keypoint there, and the ones that are there can be dragged.
// Places go to the server as shares of the picture's width and height; it knows the camera.
(function frameClicks() {
  let dragged = null;

  function place(frame, event) {
    const share = (value, low, size) => Math.min(Math.max((value + 0.5 - low) / size, 0), 1).toFixed(6);
    return {
      frame: frame.stage.dataset.shown,
      u: share(event.clientX, frame.box.left, frame.box.width),
      v: share(event.clientY, frame.box.top, frame.box.height),
      across: frame.box.width.toFixed(1),
      lens: frame.stage.querySelector(".gazeloc-overlay").hidden ? "1" : "0",
    };
  }

  function stop(event) {
    event.stopPropagation();
    event.preventDefault();
  }

  function down(event) {
    if (event.button !== 0) return;
    const frame = window.gazelocLens.frameAt(event.clientX, event.clientY, event.target);
    if (!frame || !frame.stage.dataset.shown) return;
    const grip = event.target.closest(".gazeloc-grip");
    if (grip) {
      stop(event);
      dragged = { grip, mark: grip.parentNode, frame, from: [event.clientX, event.clientY], id: event.pointerId };
      window.gazelocLens.hold(true);
    } else if (event.shiftKey) {
      stop(event);
      window.gazeloc.ask("frame-click", place(frame, event));
    }
  }

  function move(event) {
    if (!dragged || event.pointerId !== dragged.id) return;
    stop(event);
    const box = dragged.mark.ownerSVGElement.viewBox.baseVal, rect = dragged.frame.box;
    const x = ((event.clientX - dragged.from[0]) * box.width) / rect.width;
    const y = ((event.clientY - dragged.from[1]) * box.height) / rect.height;
    dragged.mark.setAttribute("transform", `translate(${x} ${y})`);
    dragged.at = [event.clientX - dragged.from[0], event.clientY - dragged.from[1]];
  }

  function up(event) {
    if (!dragged || event.pointerId !== dragged.id) return;
    stop(event);
    const { grip, mark, frame, at } = dragged;
    dragged = null;
    window.gazelocLens.hold(false);
    const isMoved = at && Math.hypot(...at) >= 1 && mark.isConnected && event.type === "pointerup";
    if (!isMoved) {
      mark.removeAttribute("transform");
      return;
    }
    // The mark goes by as much as the pointer did, wherever it was gripped.
    const view = mark.ownerSVGElement.viewBox.baseVal;
    const u = Number(grip.getAttribute("cx")) / view.width + at[0] / frame.box.width;
    const v = Number(grip.getAttribute("cy")) / view.height + at[1] / frame.box.height;
    if (u < 0 || u > 1 || v < 0 || v > 1) {
      mark.removeAttribute("transform");
      return;
    }
    const where = { frame: grip.dataset.frame, key: grip.dataset.key, u: u.toFixed(6), v: v.toFixed(6) };
    window.gazeloc.ask("frame-click", where);
  }

  addEventListener("pointerdown", down, true);
  addEventListener("pointermove", move, true);
  addEventListener("pointerup", up, true);
  addEventListener("pointercancel", up, true);
})();
