// Sorts the tables of a report: a header's button sorts by its column, and once more in the other order.
"use strict";

// Returns the parts of a cell, text and numbers in turn; none of a cell without a value.
function key(row, column) {
  const text = row.cells[column].textContent.trim().replaceAll("−", "-");
  const parts = text.split(/((?:(?<!\w)-)?\d+(?:\.\d+)?(?:e[-+]?\d+)?)/i);
  return text === "" || text === "–" ? [] : parts;
}

// Compares two keys: cells without a value come last in either order.
function compare(a, b, sign) {
  if (a.length === 0 || b.length === 0) {
    return (a.length === 0) - (b.length === 0);
  }
  for (let k = 0; k < Math.min(a.length, b.length); k++) {
    const order = k % 2 === 1 ? a[k] - b[k] : a[k].localeCompare(b[k]);
    if (order !== 0) {
      return sign * order;
    }
  }
  return sign * (a.length - b.length);
}

function sort(header) {
  const table = header.closest("table");
  const order = header.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
  for (const other of table.querySelectorAll("th")) {
    other.removeAttribute("aria-sort");
  }
  header.setAttribute("aria-sort", order);
  const sign = order === "ascending" ? 1 : -1;
  const column = header.cellIndex;
  const keyed = [...table.tBodies[0].rows].map((row) => [key(row, column), row]);
  keyed.sort(([a], [b]) => compare(a, b, sign));
  table.tBodies[0].append(...keyed.map(([, row]) => row));
}

for (const button of document.querySelectorAll("th button")) {
  button.addEventListener("click", () => sort(button.closest("th")));
}
