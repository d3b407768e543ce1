// Sorts the tables of a report: a header's button sorts by its column, and once more in the other order.
"use strict";

// Returns the text before the first number of a cell, and that number.
function key(row, column) {
  const text = row.cells[column].textContent.trim().replace("−", "-");
  const found = text.match(/^(.*?)(-?\d[\d.]*(?:e[-+]?\d+)?)/i);
  return found ? [found[1], Number(found[2])] : [text, NaN];
}

// Compares two keys: cells without text come last in either order.
function compare([textA, a], [textB, b], sign) {
  const empty = (text, number) => text === "" && Number.isNaN(number);
  if (empty(textA, a) || empty(textB, b)) {
    return empty(textA, a) - empty(textB, b);
  }
  const byText = textA.localeCompare(textB);
  const byNumber = Number.isNaN(a) || Number.isNaN(b) ? Number.isNaN(a) - Number.isNaN(b) : a - b;
  return sign * (byText || byNumber);
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
