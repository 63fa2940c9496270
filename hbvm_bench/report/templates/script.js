"use strict";
// Without this script the page says the same; with it the table sorts and the theme changes.
(() => {
  const root = document.documentElement;
  const theme = document.getElementById("theme");
  const isDark = () =>
    root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  const label = () => { theme.textContent = isDark() ? "Light" : "Dark"; };
  theme.hidden = false;
  theme.addEventListener("click", () => { root.dataset.theme = isDark() ? "light" : "dark"; label(); });
  label();

  for (const table of document.querySelectorAll("table.results")) {
    const heads = [...table.tHead.rows[0].cells];
    for (const head of heads.filter((cell) => "sort" in cell.dataset)) {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        for (const other of heads) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", "ascending");
        const value = (row) => {
          const text = row.cells[head.cellIndex].dataset.value;
          return text === "" ? Infinity : Number(text);
        };
        for (const body of table.tBodies) {
          const rows = [...body.rows].filter((row) => !row.classList.contains("group"));
          const keyed = rows.map((row) => [value(row), row]);
          keyed.sort((a, b) => (a[0] < b[0] ? -1 : a[0] > b[0] ? 1 : 0));
          body.append(...keyed.map((pair) => pair[1]));
        }
      });
    }
  }
})();
