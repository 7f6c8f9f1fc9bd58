// Tables and code that are wider than their place say that they scroll (pages.css).
function mark() {
  for (const frame of document.querySelectorAll("article .table-wrapper, article pre"))
    frame.classList.toggle("scrolls", frame.scrollWidth > frame.clientWidth + 1);
}
addEventListener("load", mark);
addEventListener("resize", mark);
