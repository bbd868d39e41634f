"use strict";
const $ = id => document.getElementById(id);
const bytes = async text => {
  const packed = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
};
const compiled = bytes(MODULE).then(WebAssembly.compile);
/** A canvas in pixels of the screen, cleared. */
function begin(canvas) {
  const ratio = devicePixelRatio || 1, { clientWidth: w, clientHeight: h } = canvas;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio);
    canvas.height = Math.round(h * ratio);
  }
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, w, h);
  return [c, w, h];
}
const colour = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name);
/** Bars of values between two limits. */
function bars(canvas, values, low, high, text) {
  const [c, w, h] = begin(canvas);
  c.fillStyle = colour("accent");
  values.forEach((v, i) => {
    const y = (h - 16) * Math.min(1, Math.max(.01, (v - low) / (high - low)));
    c.fillRect(i * w / values.length, h - y, Math.max(1, w / values.length - 1), y);
  });
  c.fillStyle = colour("soft");
  c.font = "12px system-ui, sans-serif";
  c.fillText(text, 2, 11);
}
