/** Name, unit, index, from, to; logarithmic. */
const SLIDERS = [
  ["weight of the angle", "1/rad²", 1, 5, 100], ["weight of the position", "1/m²", 0, .3, 10], ["weight of the velocity", "s²/m²", 2, .01, 1],
  ["weight of the rate", "s²/rad²", 3, .01, .5], ["weight of the force", "1/N²", 4, .001, .05], ["largest force", "N", 5, 7, 50], ["half of the track", "m", 6, .6, 1.8],
];
const pendulum = { paused: false, pull: null, keys: [0, 0], history: [] };
(async () => {
  const { exports: e } = await WebAssembly.instantiate(await compiled, { page: { now: () => performance.now(), iterated() {} } });
  const list = (place, n) => new Float64Array(e.memory.buffer, place, n);
  const check = failed => {
    if (failed) throw new Error(new TextDecoder().decode(new Uint8Array(e.memory.buffer, e.message(), e.message_length())));
  };
  const settings = () => list(e.pendulum_settings(), 7), state = () => list(e.pendulum_state(), 12);
  const canvas = $("scene");
  const reset = () => { check(e.pendulum_reset()); pendulum.history = []; $("said").textContent = ""; };
  /** What fails is said, and the pendulum hangs again; where even that fails, it stops. */
  const attempt = action => {
    try { action(); } catch (error) {
      let after = "It hangs again.";
      try { reset(); } catch { pendulum.paused = true; after = "Load the page again."; }
      $("said").textContent = `${error.message} ${after}`;
    }
  };
  const pause = () => { pendulum.paused = !pendulum.paused; $("pause").setAttribute("aria-pressed", pendulum.paused); $("pause").textContent = pendulum.paused ? "Go on" : "Pause"; };
  for (const [name, unit, index, low, high] of SLIDERS) {
    const label = document.createElement("label"), slider = document.createElement("input"), output = document.createElement("output");
    Object.assign(slider, { type: "range", min: Math.log(low), max: Math.log(high), step: .01, value: Math.log(settings()[index]), id: "setting-" + index });
    const show = value => { output.textContent = `${value.toPrecision(2)} ${unit}`; slider.setAttribute("aria-valuetext", output.textContent); };
    show(settings()[index]);
    slider.oninput = () => { const value = Math.exp(slider.value); settings()[index] = value; attempt(() => check(e.pendulum_apply())); show(value); };
    label.append(name, output, slider);
    $("sliders").append(label);
  }
  const scale = () => canvas.clientWidth / 5.2;
  const place = event => { const r = canvas.getBoundingClientRect(); return [(event.clientX - r.left - r.width / 2) / scale(), (r.height / 2 + 20 - event.clientY + r.top) / scale()]; };
  const ball = (x, angle) => [x - .8 * Math.sin(angle), .8 * Math.cos(angle)];
  canvas.onpointerdown = event => { canvas.setPointerCapture(event.pointerId); pendulum.pull = place(event); };
  canvas.onpointermove = event => { if (pendulum.pull) pendulum.pull = place(event); };
  canvas.onpointerup = canvas.onpointercancel = () => { pendulum.pull = null; };
  canvas.onkeydown = event => {
    const side = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    // A cart is pushed by less than the controller has.
    if (side) pendulum.keys = event.shiftKey ? [.6 * settings()[5] * side, 0] : [0, 2 * side];
    else if (event.key === " ") pause();
    else if (event.key.toLowerCase() === "r") reset();
    else return;
    event.preventDefault();
  };
  canvas.onkeyup = canvas.onblur = () => { pendulum.keys = [0, 0]; };
  $("reset").onclick = reset;
  $("pause").onclick = pause;
  /** Time goes on; what a sample took is remembered. */
  pendulum.advance = (seconds, cart = 0, right = 0, up = 0) => {
    const before = state().slice();
    check(e.pendulum_advance(seconds, cart, right, up));
    const now = state(), samples = now[7] - before[7];
    if (samples > 0) pendulum.history.push([(now[5] - before[5]) / samples, (now[6] - before[6]) / samples]);
    if (pendulum.history.length > 100) pendulum.history.shift();
  };
  pendulum.state = () => [...state()];
  pendulum.reset = reset;
  const draw = () => {
    const [c, w, h] = begin(canvas), k = scale(), [x, angle, , , force] = state();
    const at = ([a, b]) => [w / 2 + k * a, h / 2 + 20 - k * b], line = (a, b) => { c.beginPath(); c.moveTo(...at(a)); c.lineTo(...at(b)); c.stroke(); };
    const dot = (p, r) => { c.beginPath(); c.arc(...at(p), r, 0, 7); c.fill(); };
    c.lineCap = "round";
    const track = settings()[6];
    c.strokeStyle = colour("line"); c.lineWidth = 3;
    line([-2.6, 0], [2.6, 0]);
    c.strokeStyle = colour("soft"); line([-track, 0], [track, 0]); line([-track, -.07], [-track, .07]); line([track, -.07], [track, .07]);
    const n = e.pendulum_nodes(), plan = list(e.pendulum_plan(), 5 * n), points = [...Array(n).keys()].map(i => ball(plan[5 * i], plan[5 * i + 1]));
    c.strokeStyle = c.fillStyle = colour("plan"); c.lineWidth = 2;
    for (let i = 1; i < n; i++) { c.globalAlpha = 1 - .8 * i / n; line(points[i - 1], points[i]); if (i % 5 === 0) { dot(points[i], 4); c.globalAlpha *= .3; line([plan[5 * i], 0], points[i]); } }
    c.globalAlpha = 1;
    const b = ball(x, angle);
    if (pendulum.pull) { c.strokeStyle = colour("soft"); c.setLineDash([4, 5]); line(b, pendulum.pull); c.setLineDash([]); }
    c.strokeStyle = colour("ink"); c.lineWidth = 5; line([x, 0], b);
    c.fillStyle = colour("ink"); c.fillRect(at([x, 0])[0] - 32, at([x, 0])[1] - 14, 64, 28);
    c.strokeStyle = colour("plan"); c.lineWidth = 4; if (Math.abs(force) > .05) line([x, -.28], [x + force / 20, -.28]);
    c.fillStyle = colour("accent"); dot(b, 15);
  };
  const show = () => {
    const s = state(), mean = i => pendulum.history.reduce((sum, row) => sum + row[i], 0) / Math.max(1, pendulum.history.length);
    $("prepare").textContent = `${mean(0).toFixed(2)} ms`;
    $("feedback").textContent = `${mean(1).toFixed(2)} ms`;
    $("iterations").textContent = s[9];
    $("angle").textContent = `${(180 / Math.PI * (s[1] - s[10])).toFixed(1)}°, ${s[4].toFixed(1)} N`;
    bars($("times"), pendulum.history.map(([a, b]) => a + b), 0, 4, "time per sample, ms: up to 4");
  };
  reset();
  let last = performance.now(), frames = 0;
  const frame = now => {
    requestAnimationFrame(frame);
    const seconds = Math.min(.05, Math.max(0, (now - last) / 1000));
    last = now;
    if (!pendulum.paused && seconds > 0) {
      let [cart, right, up] = [pendulum.keys[0], pendulum.keys[1], 0];
      if (pendulum.pull) {
        const s = state(), b = ball(s[0], s[1]), d = [pendulum.pull[0] - b[0], pendulum.pull[1] - b[1]], f = Math.min(4, 2.5 / Math.max(1e-9, Math.hypot(...d)));
        [right, up] = [right + f * d[0], f * d[1]];
      }
      attempt(() => pendulum.advance(seconds, cart, right, up));
    }
    draw();
    if (frames++ % 6 === 0) show();
  };
  requestAnimationFrame(frame);
  pendulum.ready = true;
})();
