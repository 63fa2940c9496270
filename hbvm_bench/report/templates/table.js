// The table of results: sorting within its groups, filtering by words, problem, library and outcome,
// the lesser columns on demand. Without this script all of it is there.
(() => {
  const table = document.querySelector("table.results");
  if (!table) return;
  const heads = [...table.tHead.rows[0].cells];
  const rows = [...table.querySelectorAll("tbody tr:not(.group)")];

  const keyOf = (head) => (row) => {
    const cell = row.cells[head.cellIndex];
    if (head.dataset.sort === "text") return cell.textContent.trim().toLowerCase();
    const number = parseFloat(cell.dataset.v ?? cell.firstChild.data);
    return Number.isNaN(number) ? Infinity : number;
  };
  for (const head of heads.filter((cell) => "sort" in cell.dataset)) {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const value = keyOf(head);
      for (const body of table.tBodies) {
        const keyed = [...body.rows].filter((row) => !row.classList.contains("group")).map((row) => [value(row), row]);
        // what has no number stays last, whichever way
        keyed.sort(([a], [b]) =>
          a === b ? 0 : a === Infinity ? 1 : b === Infinity ? -1 : (a < b ? -1 : 1) * (down ? -1 : 1));
        body.append(...keyed.map((pair) => pair[1]));
      }
    });
  }

  const form = document.getElementById("filter");
  form.hidden = false;
  const count = form.querySelector("output");
  const texts = new Map(rows.map((row) => [row, row.textContent.toLowerCase()]));
  const apply = () => {
    const words = form.elements.words.value.toLowerCase().split(/\s+/).filter(Boolean);
    const problem = form.elements.problem ? form.elements.problem.value : "";
    const library = form.elements.library.value;
    const groups = new Set([...form.querySelectorAll("[name=group]:checked")].map((box) => box.value));
    let shown = 0;
    for (const row of rows) {
      const fits =
        (!problem || row.parentElement.dataset.problem === problem) &&
        (!library || row.dataset.library === library) &&
        groups.has(row.parentElement.dataset.group) &&
        words.every((word) => texts.get(row).includes(word));
      row.hidden = !fits;
      shown += fits;
    }
    table.classList.toggle("brief", form.elements.all?.checked === false);
    for (const body of table.tBodies) body.hidden = [...body.rows].every((row) => row.hidden || row.classList.contains("group"));
    count.textContent = shown === rows.length ? `${rows.length} cases` : `${shown} of ${rows.length} cases`;
  };
  let due = 0;
  form.addEventListener("input", () => { cancelAnimationFrame(due); due = requestAnimationFrame(apply); });
  form.addEventListener("reset", () => requestAnimationFrame(apply));
  form.addEventListener("submit", (event) => event.preventDefault());
  apply();
})();
