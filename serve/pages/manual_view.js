// One view on the screen: its X-ray and its DRR, compared in several ways; and what a person does there with the mouse.
import {make} from "/shared.js";

const kColors = {field: "#56b4e9", cross: "#e69f00", letters: "#ffffff", part: "#e69f00", box: "#f0e442", mark: "#f0e442"};

// Brightness and contrast of 256 grays, both from -100 to 100.
const table = ({brightness, contrast}) => Uint8ClampedArray.from({length: 256}, (_, gray) =>
  (gray - 128) * Math.pow(4, contrast / 100) + 128 + 1.28 * brightness);

export class ManualView {
  // `on.drag(view, pixels)` and `on.turn(view, degrees)` are called while the patient is moved, `on.rest()` after that.
  // While `on.tool()` is "box" or "mark", the mouse draws a box or calls `on.mark(view, isDrr, pixel)` instead.
  constructor(place, view, xray, on) {
    Object.assign(this, view);
    [this.columns, this.rows] = view.sizes[0];
    this.xray = xray;
    this.drr = null;      // bytes
    this.detail = 0;      // of the DRR
    this.zoom = 1;
    this.center = [this.columns / 2, this.rows / 2];  // pixel in the middle
    this.on = on;
    this.outline = [];      // of the part that is shown
    this.box = null;        // what is compared: first column, first row, last column, last row
    this.marks = [[], []];  // of landmarks, in the X-ray and in the DRR: {pixel, number}
    this.panel = make("figure", undefined, {class: "view"});
    this.panel.append(make("figcaption", view.label));
    const canvas = name => this.panel.appendChild(
      make("canvas", undefined, {tabindex: "0", role: "img", "aria-label": view.label + ", " + name}));
    this.canvases = [canvas("X-ray and DRR"), canvas("DRR")];
    this.buffer = new OffscreenCanvas(this.columns, this.rows);
    place.append(this.panel);
    for (const one of this.canvases) this.listen(one);
  }

  get hasFocus() { return this.canvases.includes(document.activeElement); }

  // CSS pixels per pixel of the view.
  get scale() { return this.edge * this.zoom / Math.max(this.columns, this.rows); }

  // How large a canvas is, CSS pixels along an edge.
  resize(edge, isDouble) {
    this.edge = edge;
    for (const one of this.canvases) {
      one.width = one.height = Math.round(edge * devicePixelRatio);
      one.style.width = one.style.height = edge + "px";
    }
    this.canvases[1].hidden = !isDouble;
  }

  listen(canvas) {
    let from = null, corner = null;
    canvas.addEventListener("pointerdown", event => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus();
      event.preventDefault();
      const at = this.pixelAt(canvas, event);
      if (this.on.tool() === "mark") this.on.mark(this, canvas === this.canvases[1], at);
      else if (this.on.tool() === "box") corner = at;
      else from = [event.clientX, event.clientY];
    });
    canvas.addEventListener("pointermove", event => {
      if (corner) {
        this.box = this.boxBetween(corner, this.pixelAt(canvas, event));
        this.on.look();
      }
      if (!from) return;
      const by = [(event.clientX - from[0]) / this.scale, (event.clientY - from[1]) / this.scale];
      if (event.altKey || event.buttons === 4) {
        this.center = this.center.map((value, n) => value - by[n]);
        this.on.look();
      } else if (event.shiftKey) {
        this.on.turn(this, this.angleAbout(canvas, from, [event.clientX, event.clientY]));
      } else {
        this.on.drag(this, by);
      }
      from = [event.clientX, event.clientY];
    });
    const end = () => {
      if (corner) { corner = null; this.on.boxed(); }
      if (from) { from = null; this.on.rest(); }
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      if (event.ctrlKey) this.zoomBy(event.deltaY < 0 ? 1.2 : 1 / 1.2);
      else this.on.wheel(this, event.deltaY < 0 ? 1 : -1);
    }, {passive: false});
  }

  zoomBy(factor) {
    this.zoom = Math.max(1, Math.min(16, this.zoom * factor));
    if (this.zoom === 1) this.center = [this.columns / 2, this.rows / 2];
    this.on.look();
  }

  // Column and row under the mouse; centers of pixels are whole numbers.
  pixelAt(canvas, {clientX, clientY}) {
    const box = canvas.getBoundingClientRect();
    return [clientX - box.left, clientY - box.top].map((at, n) => (at - this.edge / 2) / this.scale + this.center[n] - 0.5);
  }

  // Nothing for a box that is hardly there.
  boxBetween(a, b) {
    const kLeast = 8, most = [this.columns - 1, this.rows - 1];
    const whole = pick => a.map((value, n) => Math.max(0, Math.min(most[n], Math.round(pick(value, b[n])))));
    const first = whole(Math.min), last = whole(Math.max);
    return last.every((value, n) => value - first[n] >= kLeast) ? [...first, ...last] : null;
  }

  // How far the mouse has turned about the isocenter on the canvas, degrees, clockwise.
  angleAbout(canvas, from, to) {
    const box = canvas.getBoundingClientRect();
    const [x, y] = this.isocenter_px.map((value, n) => (value + 0.5 - this.center[n]) * this.scale + this.edge / 2);
    const angle = ([px, py]) => Math.atan2(py - box.top - y, px - box.left - x);
    const turn = (angle(to) - angle(from)) * 180 / Math.PI;
    return turn > 180 ? turn - 360 : turn < -180 ? turn + 360 : turn;
  }

  // The grays of the DRR at every pixel of the view.
  drrPixels() {
    if (!this.drr) return new Uint8Array(this.xray.length);
    if (this.detail === 0) return this.drr;
    const pixels = new Uint8Array(this.xray.length), [columns, rows] = this.sizes[this.detail];
    for (let row = 0, n = 0; row < this.rows; ++row) {
      const begin = Math.min(row >> this.detail, rows - 1) * columns;
      for (let column = 0; column < this.columns; ++column, ++n)
        pixels[n] = this.drr[begin + Math.min(column >> this.detail, columns - 1)];
    }
    return pixels;
  }

  // `look`: mode, wipe (share of the width), isFlickered, grays of both images, and what is marked.
  draw(look) {
    const xray = this.xray, drr = this.drrPixels();
    const tables = {xray: table(look.xray), drr: table(look.drr)};
    const gray = (pixels, table) => (data, n, at) => { data[at] = data[at + 1] = data[at + 2] = table[pixels[n]]; };
    const asXray = gray(xray, tables.xray), asDrr = gray(drr, tables.drr);
    const wipedAt = Math.round(look.wipe * this.columns);
    const painters = {
      side: asXray,
      wipe: (data, n, at) => (n % this.columns < wipedAt ? asXray : asDrr)(data, n, at),
      flicker: look.isFlickered ? asDrr : asXray,
      blend: (data, n, at) => {
        data[at] = data[at + 2] = tables.xray[xray[n]];
        data[at + 1] = tables.drr[drr[n]];
      },
      difference: (data, n, at) => {
        data[at] = data[at + 1] = data[at + 2] = 128 + (tables.xray[xray[n]] - tables.drr[drr[n]]) / 2;
      }
    };
    this.paint(this.canvases[0], painters[look.mode], look);
    if (look.mode === "side") this.paint(this.canvases[1], asDrr, look);
    if (look.mode === "wipe") this.line(this.canvases[0], wipedAt);
  }

  paint(canvas, painter, look) {
    const image = new ImageData(this.columns, this.rows), data = image.data;
    for (let n = 0, at = 0; n < this.xray.length; ++n, at += 4) {
      painter(data, n, at);
      data[at + 3] = 255;
    }
    this.buffer.getContext("2d").putImageData(image, 0, 0);
    const context = this.begin(canvas);
    context.imageSmoothingEnabled = this.scale * devicePixelRatio < 3;
    context.drawImage(this.buffer, 0, 0);
    if (look.marks.field) this.drawField(context);
    this.drawLines(context, this.outline, kColors.part);
    if (this.box) this.drawBox(context, this.box);
    if (look.marks.cross) this.drawCross(context);
    for (const mark of this.marks[this.canvases.indexOf(canvas)]) this.drawMark(context, mark);
    context.setTransform(1, 0, 0, 1, 0, 0);
    if (look.marks.letters) this.drawLetters(context, canvas.width);
  }

  // Pixel (0, 0) of the view is a square from 0 to 1: its center lies at 0.5.
  begin(canvas) {
    const context = canvas.getContext("2d"), scale = this.scale * devicePixelRatio;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = "#000";
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.setTransform(scale, 0, 0, scale, canvas.width / 2 - scale * this.center[0],
                         canvas.height / 2 - scale * this.center[1]);
    context.lineWidth = 1.5 * devicePixelRatio / scale;
    return context;
  }

  drawLines(context, polygons, color) {
    context.strokeStyle = color;
    for (const polygon of polygons) {
      context.beginPath();
      for (const [x, y] of polygon) context.lineTo(x + 0.5, y + 0.5);
      context.closePath();
      context.stroke();
    }
  }

  drawField(context) {
    const dash = 6 / this.scale;
    context.setLineDash([dash, dash]);
    this.drawLines(context, this.field, kColors.field);
    context.setLineDash([]);
  }

  drawBox(context, [c0, r0, c1, r1]) {
    context.strokeStyle = kColors.box;
    context.strokeRect(c0, r0, c1 + 1 - c0, r1 + 1 - r0);
  }

  drawMark(context, {pixel: [x, y], number}) {
    const radius = 6 / this.scale;
    context.strokeStyle = context.fillStyle = kColors.mark;
    context.beginPath();
    context.arc(x + 0.5, y + 0.5, radius, 0, 2 * Math.PI);
    context.stroke();
    context.font = "bold " + 14 / this.scale + "px \"DejaVu Sans\", Arial, sans-serif";
    context.fillText(number, x + 0.5 + 1.3 * radius, y + 0.5 - radius);
  }

  drawCross(context) {
    const [x, y] = this.isocenter_px.map(value => value + 0.5), arm = 12 / this.scale;
    context.strokeStyle = kColors.cross;
    context.beginPath();
    context.moveTo(x - arm, y);
    context.lineTo(x + arm, y);
    context.moveTo(x, y - arm);
    context.lineTo(x, y + arm);
    context.stroke();
  }

  // The patient's directions at the edges, and a length.
  drawLetters(context, edge) {
    const size = 15 * devicePixelRatio, half = edge / 2;
    context.font = "bold " + size + "px \"DejaVu Sans\", Arial, sans-serif";
    context.fillStyle = kColors.letters;
    context.strokeStyle = "#000";
    context.lineWidth = 3 * devicePixelRatio;
    context.textBaseline = "middle";
    const write = (text, x, y, align) => {
      context.textAlign = align;
      context.strokeText(text, x, y);
      context.fillText(text, x, y);
    };
    const [left, right, top, bottom] = this.directions;
    write(left, size / 3, half, "left");
    write(right, edge - size / 3, half, "right");
    write(top, half, size, "center");
    write(bottom, half, edge - size, "center");
    const perMm = Math.hypot(...this.px_per_mm.map(row => row[0]), ...this.px_per_mm.map(row => row[1]),
                             ...this.px_per_mm.map(row => row[2])) / Math.SQRT2;
    const mm = [100, 50, 20, 10, 5, 2, 1].find(one => one * perMm * this.scale < this.edge / 3) || 1;
    const length = mm * perMm * this.scale * devicePixelRatio;
    context.fillRect(size / 2, edge - 1.2 * size, length, 3 * devicePixelRatio);
    write(mm + " mm", size / 2, edge - 2 * size, "left");
  }

  line(canvas, column) {
    const context = canvas.getContext("2d");
    const x = canvas.width / 2 + this.scale * devicePixelRatio * (column - this.center[0]);
    context.fillStyle = kColors.cross;
    context.fillRect(x - devicePixelRatio / 2, 0, devicePixelRatio, canvas.height);
  }
}
