// The system in space: panes side by side, one clock; our own projection on plain canvases.
document.addEventListener("data", ({ detail }) => {
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const make = (tag, attributes = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };

  for (const [key, motion] of Object.entries(detail.motions)) {
    const figure = document.getElementById(key);
    if (!figure) continue;
    for (const one of motion.panes.flat()) {
      one.y = Array.from({ length: 9 }, (_, i) => {
        let sum = 0;
        return one.channels[i] ? Float32Array.from(one.channels[i], (step) => (sum += step) / motion.grain) : null;
      });
      delete one.channels;
    }
    const last = Math.max(...motion.panes.flat().map((one) => one.end));
    const view = { yaw: motion.camera[0], pitch: motion.camera[1] };
    let now = 0, playing = false, stamp = 0, speed = 8;

    const index = (one, t) => {
      if (one.regular) return (t - one.t[0]) / one.t[1];
      let low = 0, high = one.n - 1;
      while (high - low > 1) { const middle = (low + high) >> 1; (one.t[middle] <= t ? (low = middle) : (high = middle)); }
      return low + Math.min(1, (t - one.t[low]) / (one.t[high] - one.t[low] || 1));
    };
    const at = (one, channel, place) => {
      const values = one.y[channel];
      if (!values) return 0;
      const i = Math.max(0, Math.min(one.n - 2, Math.floor(place)));
      const u = Math.max(0, Math.min(1, place - i));
      const [a, b, c, d] = [values[Math.max(0, i - 1)], values[i], values[i + 1], values[Math.min(one.n - 1, i + 2)]];
      return b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a)));
    };

    const panes = motion.panes.map((cases, number) => {
      const canvas = make("canvas", { tabindex: "0", role: "img" });
      const told = make("p", { class: "told" });
      const pane = make("div", { class: "pane" });
      let shown = cases[0];
      const name = () => canvas.setAttribute("aria-label", `${shown.method} in space; arrow keys turn the view`);
      if (cases.length > 1) {
        const select = make("select", { "aria-label": `Case in pane ${number + 1}` });
        cases.forEach((one, i) => select.append(make("option", { value: i }, `${one.number}  ${one.method}`)));
        select.addEventListener("change", () => { shown = cases[select.value]; name(); frame(); });
        pane.append(select);
      } else pane.append(make("p", { class: "one" }, `${shown.number}  ${shown.method}`));
      name();
      pane.append(canvas, told);
      canvas.addEventListener("keydown", (event) => {
        const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
        if (!turn) return;
        event.preventDefault();
        turnBy(...turn);
      });
      let held = null;
      canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
      canvas.addEventListener("pointerup", () => { held = null; });
      canvas.addEventListener("pointermove", (event) => {
        if (!held) return;
        turnBy((event.clientX - held[0]) / 150, (event.clientY - held[1]) / 150);
        held = [event.clientX, event.clientY];
      });
      return { pane, canvas, told, get shown() { return shown; } };
    });
    const turnBy = (yaw, pitch) => {
      view.yaw += yaw;
      view.pitch = Math.max(-1.5, Math.min(1.5, view.pitch + pitch));
      frame();
    };

    const draw = ({ canvas, told, shown }, colours) => {
      const ratio = Math.min(2, window.devicePixelRatio || 1);
      const width = canvas.clientWidth, height = canvas.clientHeight;
      if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
      const pen = canvas.getContext("2d");
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, width, height);
      const scale = Math.min(width, height / 0.8) / (2 * motion.reach);
      const [sy, cy, sp, cp] = [Math.sin(view.yaw), Math.cos(view.yaw), Math.sin(view.pitch), Math.cos(view.pitch)];
      const spot = (x, y, z) => {
        const deep = x * sy + y * cy;
        return [width / 2 + scale * (x * cy - y * sy), height / 2 - scale * (z * cp + deep * sp), deep * cp - z * sp];
      };
      const line = (points, colour, thick) => {
        pen.beginPath();
        points.forEach((p, i) => (i ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1])));
        pen.strokeStyle = colour;
        pen.lineWidth = thick;
        pen.stroke();
      };
      for (const radius of [1.25, 2.5]) {
        const ring = [];
        for (let i = 0; i <= 60; i++) ring.push(spot(radius * Math.cos(i * Math.PI / 30), radius * Math.sin(i * Math.PI / 30), 0));
        line(ring, colours.line, 1);
      }
      line([spot(0, 0, -3), spot(0, 0, 3)], colours.line, 1);
      const t = Math.min(now, shown.end);
      const bodies = [];
      for (let body = 0; body < 3; body++) {
        const colour = body === 2 ? css(`--m${shown.number}`) : colours.truth;
        const where = (time) => { const place = index(shown, time); return spot(...[0, 1, 2].map((i) => at(shown, 3 * body + i, place))); };
        const trail = [];
        const begin = Math.max(0, t - motion.revolution);
        for (let i = 0; i <= 120; i++) trail.push(where(begin + ((t - begin) * i) / 120));
        const near = trail.filter((p) => Math.abs(p[0]) < 5 * width && Math.abs(p[1]) < 5 * height);
        line(near, colour, body === 2 ? 2 : 1);
        bodies.push([trail.at(-1), body === 2 ? colour : colours.muted, body === 2 ? 5.5 : 9]);
      }
      bodies.sort((a, b) => b[0][2] - a[0][2]);
      for (const [p, colour, size] of bodies) {
        pen.beginPath();
        pen.arc(p[0], p[1], size * Math.max(0.6, Math.min(1.4, 1 - 0.03 * p[2])), 0, 7);
        pen.fillStyle = colour;
        pen.fill();
      }
      const place = index(shown, t);
      const z = at(shown, 8, place);
      const off = Math.hypot(at(shown, 6, place), at(shown, 7, place));
      const far = Math.abs(z) > 250 ? "far away" : `z = ${z.toFixed(2)}`;
      told.textContent = now > shown.end + 1e-9 && shown.status ? `${shown.status}` : `${far}${off > 0.05 ? ", off the axis" : ""}`;
    };

    const scrub = make("input", { type: "range", min: "0", max: String(last), step: "0.1", value: "0", "aria-label": "Time", class: "scrub" });
    const time = make("output", { class: "time" });
    const button = make("button", { type: "button", class: "play" }, "Play");
    const rate = make("select", { "aria-label": "Speed" });
    for (const value of [2, 8, 30, 120]) rate.append(make("option", { value, ...(value === speed ? { selected: "" } : {}) }, `${value} time units a second`));
    rate.addEventListener("change", () => { speed = Number(rate.value); });

    let colours = {};
    const frame = () => {
      if (place.hidden) return;
      scrub.value = String(now);
      scrub.setAttribute("aria-valuetext", `t = ${now.toFixed(1)}`);
      time.textContent = `t = ${now.toFixed(1)}`;
      for (const pane of panes) draw(pane, colours);
    };
    const paint = () => { colours = { line: css("--line"), truth: css("--truth"), muted: css("--muted") }; frame(); };
    const tick = (stop) => {
      if (!playing) return;
      if (stamp) now += (Math.min(100, stop - stamp) / 1000) * speed;
      stamp = stop;
      if (now >= last) now = 0;
      frame();
      requestAnimationFrame(tick);
    };
    const play = (on) => {
      playing = on;
      stamp = 0;
      button.textContent = on ? "Pause" : "Play";
      figure.dataset.playing = String(on);
      if (on) requestAnimationFrame(tick);
    };
    button.addEventListener("click", () => play(!playing));
    scrub.addEventListener("input", () => { now = Number(scrub.value); frame(); });

    const controls = make("div", { class: "controls" }, button, scrub, time, rate);
    const place = make("div", { class: "moving", hidden: "" }, make("div", { class: "panes" }, ...panes.map((pane) => pane.pane)), controls);
    figure.querySelector(".picture").after(place);

    const views = figure.querySelector(".views");
    views.hidden = false;
    const rest = views.querySelector("[data-view=picture]");
    const move = make("button", { type: "button", "data-view": "move", "aria-pressed": "false" }, "Move");
    views.append(move);
    const open = (on) => {
      place.hidden = !on;
      figure.querySelector(".picture").hidden = on;
      rest.setAttribute("aria-pressed", String(!on));
      move.setAttribute("aria-pressed", String(on));
      if (on) paint();
      else play(false);
    };
    rest.addEventListener("click", () => open(false));
    move.addEventListener("click", () => { open(true); if (!still.matches) play(true); });
    document.addEventListener("theme", paint);
    new ResizeObserver(() => frame()).observe(place);
    // it begins to move when it is seen for the first time, unless motion is unwelcome; it stops out of sight
    let begun = false;
    new IntersectionObserver(([seen]) => {
      if (seen.isIntersecting && !begun && !still.matches) { begun = true; open(true); play(true); }
      else if (!seen.isIntersecting) play(false);
    }, { threshold: 0.35 }).observe(figure);
  }
});
