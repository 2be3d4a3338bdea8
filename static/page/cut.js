// Cuts the scan open: every node /cut/<n> is a plane, and what lies on the side of its z axis is not drawn.
(function cutTheScan() {
  const viewer = window.__viserMutable;
  const scene = viewer && viewer.scene;
  if (!scene || !Object.hasOwn(scene, "onBeforeRender")) {
    setTimeout(cutTheScan, 60); // true-colors.js sets its own hook first
    return;
  }

  function planes() {
    const found = [];
    for (const [name, node] of Object.entries(viewer.nodeRefFromName)) {
      if (!node || !name.startsWith("/cut/")) continue;
      node.updateWorldMatrix(true, false);
      const m = node.matrixWorld.elements;
      const length = Math.hypot(m[8], m[9], m[10]);
      const [x, y, z] = [m[8] / length, m[9] / length, m[10] / length];
      // three.js draws what has normal · point + constant >= 0.
      found.push({ normal: { x: -x, y: -y, z: -z }, constant: x * m[12] + y * m[13] + z * m[14] });
    }
    return found;
  }

  function give(found) {
    const room = viewer.nodeRefFromName["/scan"];
    if (!room) return;
    room.traverse((part) => {
      for (const material of [part.material].flat()) {
        if (!material) continue;
        if ((material.clippingPlanes || []).length !== found.length) material.needsUpdate = true;
        material.clippingPlanes = found.length ? found : null;
      }
    });
  }

  const before = scene.onBeforeRender;
  let had = 0;
  scene.onBeforeRender = function (renderer, ...others) {
    before.call(this, renderer, ...others);
    const found = planes();
    if (found.length || had) {
      renderer.localClippingEnabled = true;
      give(found);
    }
    had = found.length;
  };
})();
