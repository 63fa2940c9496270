// Figures: interaction, tables of numbers, downloads. All of it comes from what the page carries.
(() => {
  const root = document.documentElement;
  const DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;,=>?@^_`{|}~";
  const VALUES = new Uint8Array(128);
  [...DIGITS].forEach((digit, value) => { VALUES[digit.charCodeAt(0)] = value; });
  const unpack = async (id) => {
    const text = document.getElementById(id).textContent.trim();
    const bytes = new Uint8Array(Math.floor((text.length * 4) / 5)); // five digits of base 85 are four bytes
    const view = new DataView(bytes.buffer);
    const tail = text.padEnd(Math.ceil(text.length / 5) * 5, "~");
    for (let at = 0, to = 0; at < tail.length; at += 5, to += 4) {
      let word = 0;
      for (let i = 0; i < 5; i++) word = word * 85 + VALUES[tail.charCodeAt(at + i)];
      if (to + 4 <= bytes.length) view.setUint32(to, word);
      else for (let i = 0; to + i < bytes.length; i++) bytes[to + i] = (word / 2 ** (24 - 8 * i)) & 255;
    }
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  };
  const idle = window.requestIdleCallback ?? ((f) => setTimeout(f, 50));
  const make = (tag, text, attributes = {}) => {
    const made = document.createElement(tag);
    made.textContent = text;
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    return made;
  };
  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const caseColour = (number) => (number ? colour(`--m${number}`) : colour("--truth"));

  let library = null;
  const plotly = () => (library ??= unpack("library").then((text) => {
    document.head.append(Object.assign(document.createElement("script"), { textContent: text }));
    root.dataset.plots = "ready";
    return window.Plotly;
  }));

  // --- downloads -------------------------------------------------------------------------------
  const save = (name, content, type) => {
    const url = URL.createObjectURL(new Blob([content], { type }));
    const link = Object.assign(document.createElement("a"), { href: url, download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  };
  const quoted = (value) => (/[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value);
  const csvOf = (plot) => {
    const lines = ["panel,case,name,kind,x,y"];
    for (const panel of plot.panels)
      for (const t of panel.traces)
        t.x.forEach((x, i) =>
          lines.push([panel.title, t.case || "", t.name, t.role, x ?? "", t.y[i] ?? ""].map((v) => quoted(String(v))).join(",")));
    return lines.join("\n") + "\n";
  };
  const svgOf = async (figure) => {
    const drawn = figure.querySelector(".js-plotly-plot");
    if (drawn && !figure.querySelector(".plot").hidden) {
      const url = await window.Plotly.toImage(drawn, { format: "svg", width: drawn.offsetWidth, height: drawn.offsetHeight });
      return decodeURIComponent(url.slice(url.indexOf(",") + 1));
    }
    const svg = figure.querySelector(".picture svg").cloneNode(true);
    const [, , width, height] = svg.getAttribute("viewBox").split(" ");
    svg.setAttribute("width", width);
    svg.setAttribute("height", height);
    const text = new XMLSerializer().serializeToString(svg);
    return text.replace(/var\((--[\w]+)\)/g, (_, name) => colour(name) || "#000");
  };
  const pngOf = async (figure) => {
    const image = new Image();
    image.src = "data:image/svg+xml;charset=utf-8," + encodeURIComponent(await svgOf(figure));
    await image.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: 2 * image.width, height: 2 * image.height });
    const context = canvas.getContext("2d");
    context.fillStyle = colour("--paper");
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
    return new Promise((done) => canvas.toBlob(done, "image/png"));
  };

  // --- interaction -----------------------------------------------------------------------------
  const off = new Set(); // cases that the reader has switched off, in all figures
  const drawn = new Map();
  const FONT = "ui-sans-serif,system-ui,sans-serif";

  // the first view: within the axis's own bounds, and no wider than what is shown
  const range = (spec, isLog, panel, side) => {
    if (!isLog) return {};
    const edge = { low: spec.low ?? -300, high: spec.high ?? 300 };
    const logs = panel.traces.filter((t) => !off.has(t.case)).flatMap((t) => t[side]).filter((v) => v > 0).map(Math.log10);
    if (!logs.length) return edge.low > -300 ? { range: [edge.low, edge.high] } : {};
    const [a, b] = logs.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]);
    const bottom = Math.max(edge.low, a), top = Math.min(edge.high, b);
    const [first, end] = bottom < top ? [bottom - 0.04 * (top - bottom) - 0.1, top + 0.04 * (top - bottom) + 0.1] : [Math.min(a, b) - 1, Math.max(a, b) + 1];
    return { range: [first, end], ...(end - first > 1.5 ? { dtick: Math.ceil((end - first) / 9) } : {}) };
  };

  const build = (plot, looks, figure) => {
    const wide = figure.clientWidth > 760;
    const across = wide ? plot.panels.length : 1;
    const log = figure.querySelector("[name=log]")?.checked ?? plot.panels[0].x.log;
    const layout = {
      showlegend: false,
      hovermode: "closest",
      dragmode: "zoom",
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: FONT, size: 12, color: colour("--ink") },
      margin: { l: 70, r: 16, t: 28, b: 50 },
      height: wide ? 480 : 360 * plot.panels.length,
      grid: { rows: Math.ceil(plot.panels.length / across), columns: across, pattern: "independent" },
      annotations: [],
      hoverlabel: { bgcolor: colour("--wash"), bordercolor: colour("--muted"), font: { color: colour("--ink"), family: FONT }, align: "left" },
    };
    const traces = [];
    plot.panels.forEach((panel, index) => {
      const tail = index ? String(index + 1) : "";
      const axis = (spec, isLog) => ({
        title: { text: safe(spec.label), standoff: 8 },
        type: isLog ? "log" : "linear",
        exponentformat: "power",
        gridcolor: colour("--line"),
        linecolor: colour("--muted"),
        tickcolor: colour("--muted"),
        showline: true,
        zeroline: false,
        ticks: "outside",
        automargin: true,
        nticks: 9,
        ...range(spec, isLog, panel, spec === panel.x ? "x" : "y"),
      });
      layout["xaxis" + tail] = axis(panel.x, panel.x.both ? log : panel.x.log);
      layout["yaxis" + tail] = axis(panel.y, panel.y.log);
      if (panel.square) layout["yaxis" + tail].scaleanchor = "x" + tail;
      if (panel.title) layout.annotations.push({ text: safe(panel.title), xref: `x${tail} domain`, yref: `y${tail} domain`, x: 0, y: 1.02, yanchor: "bottom", xanchor: "left", showarrow: false, font: { size: 13 } });
      const positive = panel.traces.flatMap((t) => t.y).filter((v) => v > 0);
      const least = positive.length ? Math.min(...positive.slice(0, 1e5)) / 10 : 1e-17;
      for (const t of panel.traces) {
        const look = looks[t.case] ?? { dash: "solid", symbol: "circle-open" };
        const zeros = panel.y.log ? t.y.map((v) => (v === 0 ? least : v)) : t.y;
        const lines = t.role === "law" || (t.joined && (plot.kind === "lines" || plot.kind === "paths") && t.role !== "truth");
        traces.push({
          type: "scatter",
          mode: lines ? (t.x.length < 80 && t.role === "case" ? "lines+markers" : "lines") : "markers",
          name: safe(t.case ? `${t.case}  ${t.name}` : t.name),
          x: t.x,
          y: zeros,
          customdata: t.y.map((v) => (v === 0 ? "exactly 0" : v === null ? "" : Number(v).toPrecision(3))),
          xaxis: "x" + tail,
          yaxis: "y" + tail,
          visible: !off.has(t.case),
          line: { color: caseColour(t.case), dash: t.role === "law" ? "dot" : look.dash, width: t.role === "law" ? 1.2 : 1.8 },
          marker: { color: caseColour(t.case), symbol: t.role === "truth" ? "circle-open" : look.symbol, size: plot.kind === "points" ? 11 : plot.kind === "dots" ? 3 : 5 },
          hovertemplate: `%{fullData.name}${t.note ? "<br>" + safe(t.note) : ""}<br>${safe(panel.x.label)}: %{x:.4~g}<br>${safe(panel.y.label)}: %{customdata}<extra></extra>`,
          meta: t.case,
        });
      }
    });
    return { traces, layout };
  };
  // Names come from outside: plotly reads some HTML in texts, so that none may reach it.
  const safe = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll("%{", "% {");

  const draw = async (figure) => {
    const Plotly = await plotly();
    const { plot, looks, area } = drawn.get(figure);
    const { traces, layout } = build(plot, looks, figure);
    await Plotly.react(area, traces, layout, { displayModeBar: false, responsive: true, scrollZoom: false });
    area.dataset.drawn = "true";
  };
  const redraw = () => {
    for (const [figure, { area }] of drawn) if (area.dataset.drawn && !figure.querySelector(".plot").hidden) draw(figure);
  };

  const keys = (event, area, figure) => {
    const scale = { "+": 0.8, "=": 0.8, "-": 1.25 }[event.key];
    const move = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (event.key === "0") { event.preventDefault(); return draw(figure); }
    if (!scale && !move) return undefined;
    event.preventDefault();
    const change = {};
    for (const [name, axis] of Object.entries(area._fullLayout)) {
      if (!/^[xy]axis\d*$/.test(name)) continue;
      const [a, b] = axis.range;
      const middle = (a + b) / 2, half = ((b - a) / 2) * (scale ?? 1);
      const shift = move ? move[name[0] === "x" ? 0 : 1] * (b - a) : 0;
      change[`${name}.range`] = [middle - half + shift, middle + half + shift];
    }
    return window.Plotly.relayout(area, change);
  };

  const legend = (figure, plot, looks) => {
    const field = make("fieldset", "", { class: "legend" });
    field.append(make("legend", "Cases"));
    const bar = make("div", "", { class: "bulk" });
    const numbers = [...new Set(plot.panels.flatMap((panel) => panel.traces.map((t) => t.case)))].filter(Boolean);
    const names = new Map(plot.panels.flatMap((panel) => panel.traces.map((t) => [t.case, looks[t.case]?.name ?? t.name])));
    const ours = (n) => /^(HBVM|Gauss|LineIntegral)/.test(names.get(n));
    const set = (wanted) => {
      for (const number of numbers) (wanted(number) ? off.delete(number) : off.add(number));
      sync();
      redraw();
    };
    for (const [text, wanted] of [["All", () => true], ["None", () => false], ["Ours", ours]]) {
      if (wanted === ours && numbers.every(ours) === numbers.some(ours)) continue; // it would switch nothing
      const button = make("button", text, { type: "button" });
      button.addEventListener("click", () => set(wanted));
      bar.append(button);
    }
    field.append(bar);
    const list = make("div", "", { class: "cases" });
    for (const number of numbers) {
      const label = make("label", "");
      const box = make("input", "", { type: "checkbox", "data-case": number });
      box.checked = !off.has(number);
      box.addEventListener("change", () => { (box.checked ? off.delete(number) : off.add(number)); sync(); redraw(); });
      const key = document.getElementById(`key-${number}`);
      label.append(box, key ? key.content.cloneNode(true) : "", make("b", String(number)), make("span", names.get(number)));
      list.append(label);
    }
    field.append(list);
    return field;
  };
  const sync = () => {
    for (const box of document.querySelectorAll("input[data-case]")) box.checked = !off.has(Number(box.dataset.case));
  };

  const explore = (figure, on) => {
    const plot = figure.querySelector(".plot");
    for (const button of figure.querySelectorAll("[data-view]"))
      button.setAttribute("aria-pressed", String((button.dataset.view === "explore") === on));
    figure.querySelector(".picture").hidden = on;
    plot.hidden = !on;
    if (on) draw(figure);
  };

  const prepare = (figure, plot, looks) => {
    const place = figure.querySelector(".plot");
    const area = make("div", "", { class: "area", tabindex: "0", role: "group", "aria-label": `${figure.querySelector("h3").textContent}, interactive. Plus and minus zoom, arrows move, 0 resets.` });
    area.addEventListener("keydown", (event) => keys(event, area, figure));
    const tools = make("p", "", { class: "hint" });
    if (plot.panels.some((panel) => panel.x.both)) {
      const label = make("label", "");
      const box = make("input", "", { type: "checkbox", name: "log" });
      box.checked = plot.panels[0].x.log;
      box.addEventListener("change", () => draw(figure));
      label.append(box, " logarithmic time");
      tools.append(label);
    }
    const reset = make("button", "Reset view", { type: "button" });
    reset.addEventListener("click", () => draw(figure));
    tools.append(reset, make("span", "Drag to zoom, or use + − and the arrow keys."));
    place.append(tools, area, legend(figure, plot, looks));
    drawn.set(figure, { plot, looks, area });
  };

  const numbers = (figure, table) => {
    const details = figure.querySelector("details.numbers");
    details.hidden = false;
    details.addEventListener("toggle", () => {
      if (!details.open || details.querySelector("table")) return;
      const made = make("table", "");
      made.append(make("caption", `Numbers of: ${figure.querySelector("h3").textContent}`, { class: "sr" }));
      const head = made.createTHead().insertRow();
      table.head.forEach((text, i) => head.append(make("th", text, { scope: "col", ...(i >= table.words || i === 0 ? { class: "num" } : {}) })));
      const body = made.createTBody();
      for (const row of table.rows) {
        const line = body.insertRow();
        row.forEach((text, i) => line.append(make(i === 1 ? "th" : "td", text, { ...(i === 1 ? { scope: "row" } : {}), ...(i >= table.words || i === 0 ? { class: "num" } : {}) })));
      }
      const scroll = make("div", "", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Numbers" });
      scroll.append(made);
      details.append(scroll);
    });
  };

  const start = async () => {
    const data = JSON.parse(await unpack("data"));
    for (const figure of document.querySelectorAll("figure[data-plot]")) {
      const plot = data.plots[figure.dataset.plot];
      if (!plot) continue;
      numbers(figure, plot.numbers);
      const tools = figure.querySelector(".views");
      tools.hidden = false;
      for (const button of tools.querySelectorAll("[data-view]"))
        button.addEventListener("click", () => {
          if (!drawn.has(figure)) prepare(figure, plot, data.looks);
          explore(figure, button.dataset.view === "explore");
        });
    }
    document.addEventListener("click", async (event) => {
      const link = event.target.closest("a[data-save]");
      if (!link) return;
      event.preventDefault();
      const figure = link.closest("figure");
      const name = link.getAttribute("download") || "data";
      const what = link.dataset.save;
      if (what === "svg") save(name, await svgOf(figure), "image/svg+xml");
      else if (what === "png") save(name, await pngOf(figure), "image/png");
      else if (what === "numbers") save(name, csvOf(data.plots[figure.dataset.plot]), "text/csv");
      else save(name, data.files[link.getAttribute("href")], what === "csv" ? "text/csv" : "application/json");
    });
    document.addEventListener("theme", redraw);
    root.dataset.data = "ready";
    document.dispatchEvent(new CustomEvent("data", { detail: data }));
    idle(() => plotly());
  };
  if (typeof DecompressionStream === "undefined") return; // the static page stays as it is
  start();
})();
