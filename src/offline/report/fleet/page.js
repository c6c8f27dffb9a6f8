"use strict";
// Sorts the table by the column whose head is clicked, and hides the rows that are not asked for.
(() => {
  const body = document.querySelector("tbody");
  const heads = [...document.querySelectorAll("th")];
  const rows = [...body.rows];
  const form = document.querySelector("form");
  const [find, which] = [form.querySelector("input"), form.querySelector("select")];

  const key = (row, column) => {
    const cell = row.cells[column];
    if ("value" in cell.dataset) return Number(cell.dataset.value);
    return cell.classList.contains("words") ? cell.textContent.toLowerCase() : null;
  };

  const sort = (head, column) => {
    const descending = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", descending ? "descending" : "ascending");
    const sign = descending ? -1 : 1;
    const compare = (a, b) => (typeof a === "string" ? a.localeCompare(b, "en", { numeric: true }) : a - b);
    // Rows without a value are last, in both directions.
    rows.sort((a, b) => {
      const [x, y] = [key(a, column), key(b, column)];
      if (x === null || y === null) return (x === null) - (y === null);
      return sign * compare(x, y);
    });
    body.append(...rows);
  };
  heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => sort(head, column)));

  const filter = () => {
    const text = find.value.trim().toLowerCase();
    const isShown = (row) =>
      (!text || row.textContent.toLowerCase().includes(text)) &&
      (!which.value || row.classList.contains(which.value) || row.querySelector("td." + which.value) !== null);
    rows.forEach((row) => (row.hidden = !isShown(row)));
    document.getElementById("shown").textContent = rows.filter((row) => !row.hidden).length + " of " + rows.length;
  };
  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  // The browser may have kept the values of the form from an earlier visit.
  window.addEventListener("pageshow", filter);

  // A dot of a drawing leads to its row, also if the row is hidden.
  window.addEventListener("hashchange", () => {
    const row = document.getElementById(location.hash.slice(1));
    if (row && row.hidden) {
      form.reset();
      filter();
      row.scrollIntoView();
    }
  });
})();
