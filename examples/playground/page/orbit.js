const orbit = { rows: [], turn: -2.3, tilt: .25, curve: null, guess: null, drag: null };
(async () => {
  const numbers = new Float64Array(await bytes(GUESS));
  orbit.guess = [...Array(40).keys()].map(k => [...numbers.slice(1 + 22 * k, 4 + 22 * k)]);
  const url = URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" }));
  const solve = async () => {
    $("solve").disabled = true; $("status").textContent = "solving …";
    Object.assign(orbit, { rows: [], curve: null, result: null });
    const worker = new Worker(url);
    worker.onmessage = ({ data }) => {
      if (data.row) { orbit.rows.push(data.row); [["orbit-iterations", data.row[0]], ["objective", data.row[1].toFixed(6)], ["residual", data.row[2].toExponential(1)]].forEach(([id, text]) => { $(id).textContent = text; }); return; }
      worker.terminate();
      $("solve").disabled = false;
      if (data.error) { $("status").textContent = data.error; return; }
      Object.assign(orbit, data);
      const [converged, iterations, objective, residual, took] = data.result;
      $("status").textContent = converged ? "converged" : "not converged";
      $("orbit-iterations").textContent = iterations; $("objective").textContent = objective.toFixed(8); $("residual").textContent = residual.toExponential(1); $("took").textContent = `${took.toFixed(0)} ms`;
      let sum = 0;
      for (let i = 12; i < data.curve.length; i += 15) sum += data.curve[i];
      $("power").textContent = `${(sum / data.curve.length * 15 / 1000).toFixed(2)} kW`;
      data.times.forEach((t, i) => { $("t" + i).textContent = `${t.toFixed(1)} ms`; });
    };
    worker.postMessage([await compiled, numbers]);
  };
  $("solve").onclick = solve;
  const canvas = $("space");
  canvas.onpointerdown = event => { canvas.setPointerCapture(event.pointerId); orbit.drag = [event.clientX, event.clientY]; };
  canvas.onpointermove = event => { if (!orbit.drag) return; orbit.turn += (event.clientX - orbit.drag[0]) / 150; orbit.tilt = Math.max(-.2, Math.min(1.4, orbit.tilt + (event.clientY - orbit.drag[1]) / 150)); orbit.drag = [event.clientX, event.clientY]; };
  canvas.onpointerup = canvas.onpointercancel = () => { orbit.drag = null; };
  canvas.onkeydown = event => { const side = { ArrowLeft: -1, ArrowRight: 1 }[event.key]; if (side) { orbit.turn += .1 * side; event.preventDefault(); } };
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const frame = now => {
    const [c, w, h] = begin(canvas), k = Math.min(w / 420, h / 290);
    if (!orbit.drag && !still) orbit.turn += .0015;
    const [ct, st, ci, si] = [Math.cos(orbit.turn), Math.sin(orbit.turn), Math.cos(orbit.tilt), Math.sin(orbit.tilt)];
    const at = ([x, y, z]) => { const a = x - 250, d = a * st + y * ct; return [w / 2 + k * (a * ct - y * st), h / 2 + k * (115 * ci - z * ci - d * si * .6)]; };
    const path = points => { c.beginPath(); points.forEach((p, i) => c[i ? "lineTo" : "moveTo"](...at(p))); c.stroke(); };
    c.strokeStyle = colour("line"); c.lineWidth = 1;
    for (let i = 0; i <= 5; i++) { path([[100 * i, -200, 0], [100 * i, 200, 0]]); if (i < 5) path([[0, 100 * i - 200, 0], [500, 100 * i - 200, 0]]); }
    c.strokeStyle = colour("soft"); c.setLineDash([4, 5]); path([...orbit.guess, orbit.guess[0]]); c.setLineDash([]);
    if (orbit.curve) {
      const n = orbit.curve.length / 15, point = i => orbit.curve.subarray(15 * (i % n), 15 * (i % n) + 15);
      c.lineWidth = 4;
      for (let i = 0; i < n; i++) { const p = point(i); c.strokeStyle = `hsl(${230 - 230 * Math.max(0, Math.min(1, p[12] / 16000))} 80% 52%)`; path([p, point(i + 1)]); }
      const p = point(Math.floor(now / 1000 / 13.456 * n)), body = (a, b, d) => [0, 1, 2].map(i => p[i] + 6 * (a * p[3 + i] + b * p[6 + i] + d * p[9 + i]));
      c.strokeStyle = colour("soft"); c.lineWidth = 1; path([[0, 0, 0], p]);
      c.strokeStyle = colour("ink"); c.lineWidth = 3;
      path([body(0, -2.75, 0), body(0, 2.75, 0)]); path([body(-.6, 0, 0), body(2.2, 0, 0)]); path([body(2.2, -.7, 0), body(2.2, .7, 0)]); path([body(2.2, 0, 0), body(2.4, 0, .8)]);
      c.fillStyle = colour("soft"); c.font = "13px system-ui, sans-serif"; c.fillText(`now ${(p[12] / 1000).toFixed(1)} kW, tension ${(p[13] / 1000).toFixed(2)} kN, airspeed ${p[14].toFixed(0)} m/s`, 8, h - 8);
    }
    bars($("log"), orbit.rows.map(row => Math.log10(row[2])), -7, 3, "residual, 10⁻⁷ to 10³");
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  solve();
})();
