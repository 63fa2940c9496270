// Figures that wait in the page's data, and what can be saved: figures, and tables of their numbers.
(() => {
  const root = document.documentElement;
  const unpack = (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).json();
  };
  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();

  const save = (name, content, type) => {
    const url = URL.createObjectURL(new Blob([content], { type }));
    const link = Object.assign(document.createElement("a"), { href: url, download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  };
  const quoted = ({ textContent: value }) => (/[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value);
  const csvOf = (table) => [...table.rows].map((row) => [...row.cells].map(quoted).join(",")).join("\n") + "\n";
  const svgOf = (figure) => {
    const svg = figure.querySelector(".picture svg").cloneNode(true);
    const [, , width, height] = svg.getAttribute("viewBox").split(" ");
    svg.setAttribute("width", width);
    svg.setAttribute("height", height);
    const text = new XMLSerializer().serializeToString(svg);
    return text.replace(/var\((--[\w]+)\)/g, (_, name) => colour(name) || "#000");
  };

  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[data-save]");
    if (!link) return;
    event.preventDefault();
    const figure = link.closest("figure");
    const name = link.getAttribute("download");
    if (link.dataset.save === "svg") save(name, svgOf(figure), "image/svg+xml");
    else save(name, csvOf(figure.querySelector(".numbers table")), "text/csv");
  });
  const start = async () => {
    for (const [key, svg] of Object.entries(await unpack(document.getElementById("data").textContent)))
      document.querySelector(`[id="${key}"] .picture`).innerHTML = svg;
    root.dataset.data = "ready";
  };
  if (typeof DecompressionStream === "undefined") return; // what stands in the page stays as it is
  start();
})();
