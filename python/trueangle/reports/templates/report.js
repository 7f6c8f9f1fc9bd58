"use strict";
(() => {
  const plots = [...document.querySelectorAll(".plot")];
  const root = document.documentElement;
  const paper = location.hash === "#print";
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const drawn = new Map();   // plot -> its charts: {models, figure, home}
  let figures = {};
  let chosen = null;   // a theme chosen by the button wins over the system's

  const theme = () => (paper ? "light" : chosen || (dark.matches ? "dark" : "light"));
  const colour = (name) => getComputedStyle(root).getPropertyValue(`--${name}`).trim();
  const tagged = (model, kind) => {
    const tag = (model.tags || []).find((t) => String(t).startsWith(`${kind}:`));
    return tag === undefined ? null : tag.slice(kind.length + 1);
  };

  /* Set what a model has of these properties; the rest is not its own. */
  function set(model, values) {
    const own = Object.fromEntries(Object.entries(values).filter(([name]) => name in model.properties));
    if (Object.keys(own).length) model.setv(own);
  }

  /* Colours of the theme, and what boxes hide. */
  function paint({ models }) {
    const back = paper ? null : colour("back"), fore = colour("fore"), grid = colour("grid"), line = colour("line");
    for (const model of models) {
      const name = tagged(model, "colour");
      const run = tagged(model, "run");
      if (name !== null) {
        const shade = colour(name);
        const own = { line_color: shade, fill_color: shade, text_color: shade };
        set(model.glyph || model, own);
      }
      if (run !== null) model.visible = shown(run);
      if (model.type === "Figure")
        // A border that is not filled keeps what was painted there before the layout was known.
        set(model, { background_fill_color: back, border_fill_color: back, outline_line_color: line, border_line_color: null });
      else if (/Axis$/.test(model.type))
        set(model, { axis_label_text_color: fore, major_label_text_color: fore, axis_line_color: line,
          major_tick_line_color: line, minor_tick_line_color: null, axis_label_text_font_style: "normal",
          axis_label_text_font_size: "12px", major_label_text_font_size: "12px" });
      else if (model.type === "Grid") set(model, { grid_line_color: grid });
      else if (model.type === "Legend") set(model, { label_text_color: fore });
    }
  }

  const box = (run) => document.querySelector(`.run-toggle[data-run="${run}"]`);
  const shown = (run) => !box(run) || box(run).checked;

  /* Numbers of an axis that would run into each other on a narrow screen: every second, third ... */
  function thin(figure, width) {
    const names = figure.y_range.factors || [];
    const room = Math.max(width - Math.max(70, ...names.map((name) => 6.5 * name.length)), 40);
    for (const axis of figure.below) {
      const ticks = axis.ticker.ticks;
      const every = ticks ? Math.ceil((ticks.length * 32) / room) : 1;
      if (every > 1) axis.ticker = axis.ticker.clone({ ticks: ticks.filter((_, i) => i % every === 0) });
    }
  }

  async function chart(specification, place) {
    const item = structuredClone(specification.document);
    item.doc.version = Bokeh.version;
    const attributes = item.doc.roots[0].attributes;
    // Vectors on paper; on the screen a canvas is drawn faster.
    if (paper) attributes.output_backend = "svg";
    place.replaceChildren();
    const views = await Bokeh.embed.embed_item(item, place);
    const view = Array.isArray(views) ? views[0] : [...views][0];
    const figure = view.model;
    if (!paper) thin(figure, place.clientWidth);
    // On a tablet or phone charts that go on with the axis of another stand below it.
    if (innerWidth <= 992 && !paper) for (const axis of figure.left) axis.visible = true;
    if (innerWidth < 640 && !paper) {
      for (const r of figure.renderers) if (r.glyph && r.glyph.type === "Text") r.glyph.text_font_size = "9px";
    }
    const made = { models: [...figure.references()], figure };
    // A finger that moves over a chart scrolls the page.
    if (matchMedia("(pointer: coarse)").matches) figure.toolbar.active_drag = null;
    paint(made);
    return made;
  }

  async function draw(plot) {
    const figure = figures[plot.dataset.figure];
    plot.setAttribute("aria-label", figure.alt);
    const places = [...plot.querySelectorAll(".canvas")];
    drawn.set(plot, await Promise.all(figure.charts.map((c, i) => chart(c, places[i]))));
  }

  /* Every figure is drawn once: those in sight at first, the others as time or sight allows. */
  const begun = new Map();
  const once = (plot) => begun.get(plot) || begun.set(plot, draw(plot)).get(plot);
  const inSight = (plot) => paper || (!hidden(plot) && plot.getBoundingClientRect().top < innerHeight);
  /* What is folded has no size to be drawn at; it is drawn when it is unfolded. */
  const hidden = (plot) => plot.closest("details:not([open])") !== null;
  const idle = () => new Promise((go) => (window.requestIdleCallback || setTimeout)(go));

  function repaint() {
    root.dataset.theme = theme();
    for (const charts of drawn.values()) charts.forEach(paint);
  }

  const resetAll = (plot) => (drawn.get(plot) || []).forEach(({ figure }) => {
    for (const range of [figure.x_range, figure.y_range]) range.reset();
  });

  /* Zoom (factor < 1), move or reset the angle axis by keys. */
  function key(event) {
    const plot = event.currentTarget;
    if (!drawn.has(plot)) return;
    const range = drawn.get(plot)[0].figure.x_range;
    const low = range.start, high = range.end, width = high - low, middle = (low + high) / 2;
    const move = { ArrowLeft: -0.1, ArrowRight: 0.1 }[event.key];
    const zoom = { "+": 0.7, "=": 0.7, "-": 1 / 0.7 }[event.key];
    if (move) range.setv({ start: low + move * width, end: high + move * width });
    else if (zoom) range.setv({ start: middle - zoom * width / 2, end: middle + zoom * width / 2 });
    else if (event.key === "0") resetAll(plot);
    else return;
    event.preventDefault();
  }

  /* Text that was packed with gzip in base 85: five letters hold four bytes; a page
     within another takes what that one holds. */
  async function unpacked(id) {
    const text = document.getElementById(id).textContent || parent.document.getElementById(id).textContent;
    const digit = new Uint8Array(128);
    [..."0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%:()*+-;[=]?@^_`{|}~"]
      .forEach((letter, i) => { digit[letter.charCodeAt(0)] = i; });
    const bytes = new Uint8Array((text.length / 5) * 4), view = new DataView(bytes.buffer);
    for (let i = 0, at = 0; i < text.length; i += 5, at += 4) {
      let number = 0;
      for (let k = 0; k < 5; k++) number = number * 85 + digit[text.charCodeAt(i + k)];
      view.setUint32(at, number);
    }
    const packed = bytes.subarray(4, 4 + view.getUint32(0));
    return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  }

  async function load() {
    const script = document.createElement("script");
    script.textContent = await unpacked("library");
    document.head.append(script);
    Bokeh.logger.set_level("error");
    figures = JSON.parse(await unpacked("figures"));
  }

  /* Tables that are wider than the page say so. */
  function mark() {
    for (const table of document.querySelectorAll(".scroll"))
      table.classList.toggle("wide", table.scrollWidth > table.clientWidth + 1);
  }

  async function start() {
    root.dataset.theme = theme();
    mark();
    // Before anything is loaded: who prints at once has all of it, in the colours of paper.
    let closed = [];
    addEventListener("beforeprint", () => {
      root.dataset.theme = "light";
      closed = [...document.querySelectorAll("details:not([open])")];
      closed.forEach((d) => { d.open = true; });
    });
    addEventListener("afterprint", () => { closed.forEach((d) => { d.open = false; }); repaint(); });
    addEventListener("resize", mark);
    const folded = [...document.querySelectorAll("details")];
    if (paper) folded.forEach((d) => { d.open = true; });
    if (paper) root.dataset.paper = "true";
    if (paper) document.body.style.width = "680px";
    await load();
    await Promise.all(plots.filter(inSight).map(once));
    for (const plot of plots) {
      plot.addEventListener("keydown", key);
      plot.addEventListener("dblclick", () => resetAll(plot));
    }
    document.querySelectorAll(".run-toggle").forEach((b) => b.addEventListener("change", repaint));
    document.getElementById("theme").addEventListener("click", () => {
      chosen = theme() === "dark" ? "light" : "dark";
      repaint();
    });
    dark.addEventListener("change", repaint);
    const signal = document.getElementById("signal");
    if (signal) signal.addEventListener("change", () => {
      const plot = document.getElementById("figure-residual");
      once(plot).then(() => { plot.dataset.figure = signal.value; draw(plot); });
    });
    root.dataset.ready = "true";
    // A link to a section unfolds what answers it.
    document.querySelectorAll("nav a").forEach((link) => link.addEventListener("click", () => {
      const first = document.querySelector(link.hash).closest("section").querySelector("details");
      if (first) first.open = true;
    }));
    folded.forEach((d) => d.addEventListener("toggle", () => {
      mark();
      if (d.open) d.querySelectorAll(".plot").forEach(once);
    }));
    await drawTheRest();
    root.dataset.drawn = "true";
  }

  async function drawTheRest() {
    const coming = new IntersectionObserver((seen) => seen.filter((s) => s.isIntersecting)
      .forEach((s) => { coming.unobserve(s.target); if (!hidden(s.target)) once(s.target); }), { rootMargin: "600px" });
    plots.forEach((plot) => coming.observe(plot));
    for (const plot of plots) {
      await idle();
      if (!hidden(plot)) await once(plot);
    }
  }

  start().catch((error) => {
    plots.forEach((plot) => { plot.textContent = `This figure could not be drawn: ${error.message}`; });
    root.dataset.ready = "failed";
  });
})();
