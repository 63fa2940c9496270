// Figures that wait in the page's data, tables of their numbers, and what can be saved.
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
  const make = (tag, text, attributes = {}) => {
    const made = document.createElement(tag);
    made.textContent = text;
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    return made;
  };
  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();

  const save = (name, content, type) => {
    const url = URL.createObjectURL(new Blob([content], { type }));
    const link = Object.assign(document.createElement("a"), { href: url, download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  };
  const quoted = (value) => (/[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value);
  const csvOf = (table) => [table.head, ...table.rows].map((row) => row.map(quoted).join(",")).join("\n") + "\n";
  const svgOf = (figure) => {
    const svg = figure.querySelector(".picture svg").cloneNode(true);
    const [, , width, height] = svg.getAttribute("viewBox").split(" ");
    svg.setAttribute("width", width);
    svg.setAttribute("height", height);
    const text = new XMLSerializer().serializeToString(svg);
    return text.replace(/var\((--[\w]+)\)/g, (_, name) => colour(name) || "#000");
  };

  const numbers = (figure, table) => {
    const details = figure.querySelector("details.numbers");
    details.hidden = false;
    details.addEventListener("toggle", () => {
      if (!details.open || details.querySelector("table")) return;
      const made = make("table", "");
      made.append(make("caption", `Numbers of: ${figure.querySelector(".figure-head > :first-child").textContent}`, { class: "sr" }));
      const head = made.createTHead().insertRow();
      table.head.forEach((text, i) => head.append(make("th", text, { scope: "col", ...(i >= table.words || i === 0 ? { class: "num" } : {}) })));
      const body = made.createTBody();
      for (const row of table.rows) {
        const line = body.insertRow();
        row.forEach((text, i) => line.append(make(i === 1 ? "th" : "td", text, { ...(i === 1 ? { scope: "row" } : {}), ...(i >= table.words || i === 0 ? { class: "num" } : {}) })));
      }
      const scroll = make("div", "", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Numbers" });
      scroll.append(made);
      details.append(scroll);
    });
  };

  const start = async () => {
    const data = JSON.parse(await unpack("data"));
    for (const [key, svg] of Object.entries(data.drawings))
      document.querySelector(`[id="${key}"] .picture`).innerHTML = svg;
    for (const [key, table] of Object.entries(data.numbers)) numbers(document.getElementById(key), table);
    document.addEventListener("click", (event) => {
      const link = event.target.closest("a[data-save]");
      if (!link) return;
      event.preventDefault();
      const figure = link.closest("figure");
      const name = link.getAttribute("download");
      if (link.dataset.save === "svg") save(name, svgOf(figure), "image/svg+xml");
      else save(name, csvOf(data.numbers[figure.id]), "text/csv");
    });
    root.dataset.data = "ready";
    document.dispatchEvent(new CustomEvent("data", { detail: data }));
  };
  if (typeof DecompressionStream === "undefined") return; // what stands in the page stays as it is
  start();
})();
