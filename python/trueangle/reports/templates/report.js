"use strict";
(() => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const plots = [...document.querySelectorAll(".plot")];
  const root = document.documentElement;
  const paper = location.hash === "#print";
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let chosen = null;   // a theme chosen by the button wins over the system's

  const theme = () => (paper ? "light" : chosen || (dark.matches ? "dark" : "light"));
  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();

  function axis(own, extra) {
    return { gridcolor: colour("--grid"), zerolinecolor: colour("--line"), linecolor: colour("--line"),
      automargin: true, ...own, ...extra };
  }

  function layout(figure) {
    const narrow = innerWidth < 640;
    const own = figure.layout;
    const polar = own.polar && { ...own.polar, bgcolor: "rgba(0,0,0,0)",
      angularaxis: { gridcolor: colour("--grid"), linecolor: colour("--line"), ticksuffix: "°" },
      radialaxis: { gridcolor: colour("--grid"), linecolor: colour("--line"), ...own.polar.radialaxis } };
    return { ...own, ...(polar ? { polar } : { xaxis: axis(own.xaxis), yaxis: axis(own.yaxis) }),
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { color: colour("--fore"), size: narrow ? 11 : 12 },
      margin: polar ? { l: 40, r: 40, t: 30, b: 40 } : { l: 60, r: 15, t: 10, b: 50 },
      hoverlabel: { align: "left" }, hovermode: "closest",
      showlegend: figure.data.length > 1,
      legend: polar && !narrow ? {} : { orientation: "h", y: polar ? -0.1 : 1.02, yanchor: polar ? "top" : "bottom" } };
  }

  /* Lines of a role take the theme's colours; runs keep theirs. */
  function traces(figure) {
    return figure.data.map((trace) => {
      const role = trace.meta && trace.meta.role;
      const hidden = trace.meta && trace.meta.run !== undefined && !shown(trace.meta.run);
      const made = hidden ? { ...trace, visible: false } : { ...trace };
      for (const bar of ["error_x", "error_y"])
        if (trace[bar]) made[bar] = { ...trace[bar], color: colour("--fore"), thickness: 1.2 };
      if (role === "model") made.line = { ...trace.line, color: colour("--model") };
      if (role === "band") made.fillcolor = theme() === "dark" ? "rgba(255,255,255,0.25)" : "rgba(0,0,0,0.2)";
      return made;
    });
  }

  const box = (run) => document.querySelector(`.run-toggle[data-run="${run}"]`);
  const shown = (run) => !box(run) || box(run).checked;

  function draw(plot) {
    const figure = figures[plot.dataset.figure];
    plot.setAttribute("aria-label", figure.alt);
    return Plotly.react(plot, traces(figure), layout(figure),
      { responsive: true, displaylogo: false, displayModeBar: paper ? false : "hover", modeBarButtonsToRemove: ["select2d", "lasso2d", "sendDataToCloud"] });
  }

  function drawAll() {
    root.dataset.theme = theme();
    return Promise.all(plots.map(draw));
  }

  /* Zoom (factor < 1), move or reset the angle axis by keys. */
  function key(event) {
    const full = event.currentTarget._fullLayout;
    if (!full || !full.xaxis || full.xaxis.type === "category") return;
    const [low, high] = full.xaxis.range.map(Number), width = high - low, middle = (low + high) / 2;
    const move = { ArrowLeft: -0.1, ArrowRight: 0.1 }[event.key];
    const zoom = { "+": 0.7, "=": 0.7, "-": 1 / 0.7 }[event.key];
    if (move) Plotly.relayout(event.currentTarget, { "xaxis.range": [low + move * width, high + move * width] });
    else if (zoom) Plotly.relayout(event.currentTarget, { "xaxis.range": [middle - zoom * width / 2, middle + zoom * width / 2] });
    else if (event.key === "0") Plotly.relayout(event.currentTarget, { "xaxis.autorange": true, "yaxis.autorange": true });
    else return;
    event.preventDefault();
  }

  async function load() {
    const packed = document.getElementById("library").textContent;
    const bytes = Uint8Array.from(atob(packed), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  }

  async function start() {
    root.dataset.theme = theme();
    if (paper) document.querySelectorAll("details").forEach((d) => { d.open = true; });
    if (paper) document.body.style.width = "680px";
    await load();
    await drawAll();
    plots.forEach((plot) => plot.addEventListener("keydown", key));
    document.querySelectorAll(".run-toggle").forEach((b) => b.addEventListener("change", drawAll));
    document.getElementById("theme").addEventListener("click", () => {
      chosen = theme() === "dark" ? "light" : "dark";
      drawAll();
    });
    dark.addEventListener("change", drawAll);
    const signal = document.getElementById("signal");
    if (signal) signal.addEventListener("change", () => {
      const plot = document.getElementById("figure-residual");
      plot.dataset.figure = signal.value;
      draw(plot);
    });
    addEventListener("beforeprint", () => { root.dataset.theme = "light"; });
    addEventListener("afterprint", drawAll);
    root.dataset.ready = "true";
  }

  start().catch((error) => {
    plots.forEach((plot) => { plot.textContent = `This figure could not be drawn: ${error.message}`; });
    root.dataset.ready = "failed";
  });
})();
