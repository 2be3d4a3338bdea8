// Where a picture's brightness changes most, in a colour that rooms seldom have.
window.gazelocEdges = (() => {
  const WIDTH = 700;
  const PINK = 0xe6c800ff; // opacity, blue, green, red: a pixel as one number, lowest byte first
  const SHARE = 0.07; // of all pixels are edges
  const LEAST = 6; // a change in grey levels below which nothing is one

  function draw(image, canvas) {
    const width = Math.min(image.naturalWidth, WIDTH), height = Math.round((width * image.naturalHeight) / image.naturalWidth);
    canvas.width = width;
    canvas.height = height;
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    pen.filter = "blur(0.8px)";
    pen.drawImage(image, 0, 0, width, height);
    const pixels = pen.getImageData(0, 0, width, height);
    const steep = steepness(pixels.data, width, height);
    const limit = steepest(steep), out = new Uint32Array(pixels.data.buffer);
    for (let i = 0; i < out.length; i++) out[i] = steep[i] > limit ? PINK : 0;
    pen.putImageData(pixels, 0, 0);
  }

  function steepness(data, width, height) {
    const grey = new Float32Array(width * height), steep = new Float32Array(width * height);
    for (let i = 0; i < grey.length; i++) grey[i] = 0.3 * data[4 * i] + 0.6 * data[4 * i + 1] + 0.1 * data[4 * i + 2];
    for (let y = 1; y < height - 1; y++)
      for (let i = y * width + 1; i < (y + 1) * width - 1; i++)
        steep[i] = Math.hypot(grey[i + 1] - grey[i - 1], grey[i + width] - grey[i - width]);
    return steep;
  }

  // The change that only the steepest SHARE exceeds.
  function steepest(steep) {
    const counts = new Uint32Array(512);
    for (const value of steep) counts[Math.min(value | 0, 511)]++;
    let limit = 511;
    for (let sum = 0; limit > LEAST && sum < SHARE * steep.length; limit--) sum += counts[limit];
    return limit;
  }

  return { draw };
})();
