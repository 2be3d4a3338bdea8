// Scans are shown exactly as stored: three.js would map their tones as if they were lit.
(function trueColors() {
  const scene = window.__viserMutable && window.__viserMutable.scene;
  if (!scene) {
    setTimeout(trueColors, 50);
    return;
  }
  scene.onBeforeRender = (renderer) => {
    renderer.toneMapping = 0;
  };
})();
