// Cuts the room open: every node /cut/<n> is a plane, and what lies on the side of its z axis is neither drawn nor
// under the pointer: scan, points, cameras, tags, keypoints, labels. The picture that is looked through is not cut.
(function cutTheRoom() {
  const viewer = window.__viserMutable;
  const scene = viewer && viewer.scene;
  if (!scene || !Object.hasOwn(scene, "onBeforeRender")) {
    setTimeout(cutTheRoom, 60); // true-colors.js sets its own hook first
    return;
  }
  const IN_THE_ROOM = /^\/(?!cut$|picture)[^/]+$/;
  const guarded = new WeakSet();
  let planes = [];
  let labels = null;

  function find() {
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

  function isCutAway(x, y, z) {
    return planes.some(({ normal, constant }) => normal.x * x + normal.y * y + normal.z * z + constant < 0);
  }

  function cut(part) {
    if (part.isMesh && !guarded.has(part)) guard(part);
    for (const material of [part.material].flat()) {
      if (!material) continue;
      if (part.isPoints && material.isShaderMaterial && !material.clipping) teach(material);
      if ((material.clippingPlanes || []).length !== planes.length) material.needsUpdate = true;
      material.clippingPlanes = planes.length ? planes : null;
    }
  }

  // viser's shader of points knows no cutting: these are three.js's own pieces for it.
  function teach(material) {
    const place = "vec4 mvPosition = modelViewMatrix * vec4(position, 1.0);\n#include <clipping_planes_vertex>\n";
    const begin = (text) => text.replace(/void\s+main\s*\(\s*\)\s*{/, "$&\n#include <clipping_planes_fragment>\n");
    const end = (text) => `${text.slice(0, text.lastIndexOf("}"))}${place}}`;
    material.vertexShader = `#include <clipping_planes_pars_vertex>\n${end(material.vertexShader)}`;
    material.fragmentShader = `#include <clipping_planes_pars_fragment>\n${begin(material.fragmentShader)}`;
    material.clipping = true;
    material.needsUpdate = true;
  }

  // What is cut away must not catch the pointer: a keypoint's marker could be dragged unseen.
  function guard(part) {
    guarded.add(part);
    const plain = part.raycast;
    part.raycast = function (raycaster, hits) {
      const found = [];
      plain.call(this, raycaster, found);
      hits.push(...found.filter(({ point }) => !isCutAway(point.x, point.y, point.z)));
    };
  }

  // viser draws all labels at once, from a texture with a row (x, y, z, shown or not) each, written anew every frame.
  function cutLabels() {
    if (!labels) {
      scene.traverse((part) => {
        const uniforms = part.material && part.material.uniforms;
        if (uniforms && uniforms.uLabelData) labels = uniforms.uLabelData.value;
      });
    }
    const rows = labels ? labels.image.data : [];
    for (let row = 0; row < rows.length; row += 4) {
      if (rows[row + 3] && isCutAway(rows[row], rows[row + 1], rows[row + 2])) rows[row + 3] = 0;
    }
  }

  const before = scene.onBeforeRender;
  scene.onBeforeRender = function (renderer, ...others) {
    before.call(this, renderer, ...others);
    const had = planes.length;
    planes = find();
    if (!planes.length && !had) return;
    renderer.localClippingEnabled = true;
    for (const [name, node] of Object.entries(viewer.nodeRefFromName)) {
      if (node && IN_THE_ROOM.test(name)) node.traverse(cut);
    }
    cutLabels();
  };
})();
