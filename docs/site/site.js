// Sets the formulas of a page, which stand between \( and \) or \[ and \], by KaTeX.
for (const place of document.querySelectorAll(".arithmatex")) {
  const text = place.textContent.trim();
  katex.render(text.slice(2, -2), place, {displayMode: text.startsWith("\\[")});
}
