onmessage = async ({ data: [module, guess] }) => {
  const instance = await WebAssembly.instantiate(module, { page: {
    now: () => performance.now(),
    iterated: (...row) => postMessage({ row }),
  } });
  const e = instance.exports, list = (place, n) => new Float64Array(e.memory.buffer, place, n).slice();
  new Float64Array(e.memory.buffer, e.orbit_guess(), guess.length).set(guess);
  if (e.orbit_solve()) {
    const text = new Uint8Array(e.memory.buffer, e.message(), e.message_length());
    postMessage({ error: new TextDecoder().decode(text) });
  } else {
    postMessage({ result: list(e.orbit_result(), 5), times: list(e.orbit_times(), 3), curve: list(e.orbit_curve(), 15 * e.orbit_points()) });
  }
};
