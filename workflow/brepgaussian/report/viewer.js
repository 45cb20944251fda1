// A small software renderer: triangles, discs, points and lines with a depth buffer on a 2D canvas.
// No WebGL, so that it shows the same picture on every machine, also on one without a GPU.
"use strict";
(() => {
  const canvas = document.querySelector("#view canvas"), context = canvas.getContext("2d");
  const side = document.querySelector("#side");
  const FOCAL = 4.6, DISC_SIDES = 8, LIGHT = normalise([0.45, 0.6, 0.75]); // in camera axes: right, up, back
  const BACKGROUND = 0xfff6f3f0; // light, so that white surfels show (bytes: alpha, blue, green, red)
  const LINE_BIAS = 0.006, DOT_BIAS = 0.004; // lines and dots lie on surfaces: unit lengths towards the camera
  const unpack = (text, Type) => {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return new Type(bytes.buffer);
  };
  const scaled = (text) => Float32Array.from(unpack(text, Int16Array), (v) => v / DATA.steps);
  function normalise(v) { const l = Math.hypot(...v) || 1; return v.map((x) => x / l); }
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  // --- data -------------------------------------------------------------------------------------
  const layers = DATA.layers.map((source) => {
    const layer = { ...source, positions: scaled(source.positions) };
    if (source.kind === "mesh") {
      layer.triangles = unpack(source.triangles, Uint32Array);
      layer.paints = Object.fromEntries(Object.entries(source.paints).map(([k, v]) => [k, unpack(v, Uint8Array)]));
      layer.paint = "plain";
      layer.paints.plain = layer.positions.map((_, i) => source.color[i % 3]);
      layer.normals = vertexNormals(layer.positions, layer.triangles);
    } else if (source.kind === "discs") {
      layer.u = scaled(source.along_u); layer.v = scaled(source.along_v); layer.colors = unpack(source.colors, Uint8Array);
    } else if (source.kind === "points") {
      layer.colors = unpack(source.colors, Uint8Array);
      if (source.normals) layer.normals = Float32Array.from(unpack(source.normals, Int8Array), (v) => v / 127);
    }
    return layer;
  });
  function vertexNormals(p, t) {
    const n = new Float32Array(p.length);
    for (let i = 0; i < t.length; i += 3) {
      const [a, b, c] = [3 * t[i], 3 * t[i + 1], 3 * t[i + 2]];
      const m = cross([p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]],
                      [p[c] - p[a], p[c + 1] - p[a + 1], p[c + 2] - p[a + 2]]);
      for (const k of [a, b, c]) for (let d = 0; d < 3; d++) n[k + d] += m[d];
    }
    for (let i = 0; i < n.length; i += 3) {
      const l = Math.hypot(n[i], n[i + 1], n[i + 2]) || 1;
      for (let d = 0; d < 3; d++) n[i + d] /= l;
    }
    return n;
  }

  // --- camera: a turntable about `up` --------------------------------------------------------------
  const up = DATA.camera.up;
  const east = normalise(cross(Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], up)), north = cross(up, east);
  const start = () => {
    const back = DATA.camera.back;
    return { azimuth: Math.atan2(dot(back, north), dot(back, east)),
             elevation: Math.asin(Math.max(-1, Math.min(1, dot(back, up)))), distance: 3.4, pan: [0, 0] };
  };
  let camera = start();
  function axes() {
    const { azimuth: a, elevation: e } = camera;
    const flat = [0, 1, 2].map((k) => Math.cos(a) * east[k] + Math.sin(a) * north[k]);
    const back = [0, 1, 2].map((k) => Math.cos(e) * flat[k] + Math.sin(e) * up[k]);
    const right = [0, 1, 2].map((k) => -Math.sin(a) * east[k] + Math.cos(a) * north[k]);
    return [right, cross(back, right), back];
  }

  // --- buffers -----------------------------------------------------------------------------------
  let width = 0, height = 0, image, pixels, depth;
  function resize(scale) {
    const box = canvas.getBoundingClientRect();
    const w = Math.max(1, Math.round(box.width * scale)), h = Math.max(1, Math.round(box.height * scale));
    if (w !== width || h !== height) {
      width = canvas.width = w; height = canvas.height = h;
      image = context.createImageData(w, h);
      pixels = new Uint32Array(image.data.buffer); depth = new Float32Array(w * h);
    }
    pixels.fill(BACKGROUND); depth.fill(0); // depth holds 1 / distance: larger is nearer
  }
  const rgb = (r, g, b) => 0xff000000 | (Math.min(255, b) << 16) | (Math.min(255, g) << 8) | Math.min(255, r);

  // Positions (x, y, 1 / distance) of points on the canvas.
  function project(p, out, bias = 0) {
    const [r, u, b] = axes(), zoom = (FOCAL * Math.min(width, height)) / 2;
    const [px, py] = camera.pan;
    for (let i = 0; i < p.length; i += 3) {
      const x = p[i], y = p[i + 1], z = p[i + 2];
      const d = 1 / Math.max(0.05, camera.distance - (x * b[0] + y * b[1] + z * b[2]) - bias);
      out[i] = width / 2 + zoom * (x * r[0] + y * r[1] + z * r[2] + px) * d;
      out[i + 1] = height / 2 - zoom * (x * u[0] + y * u[1] + z * u[2] + py) * d;
      out[i + 2] = d;
    }
    return out;
  }
  // How much light a normal gives, and whether it looks at the camera.
  function light(n, i, [r, u, b]) {
    const x = n[i] * r[0] + n[i + 1] * r[1] + n[i + 2] * r[2], y = n[i] * u[0] + n[i + 1] * u[1] + n[i + 2] * u[2];
    const z = n[i] * b[0] + n[i + 1] * b[1] + n[i + 2] * b[2], sign = z < 0 ? -1 : 1;
    const key = 0.5 + 0.5 * sign * (x * LIGHT[0] + y * LIGHT[1] + z * LIGHT[2]);
    return [0.36 + 0.44 * key + 0.26 * Math.abs(z), z];
  }

  // --- drawing -----------------------------------------------------------------------------------
  function triangle(q, a, b, c, ca, cb, cc) {
    const ax = q[a], ay = q[a + 1], bx = q[b], by = q[b + 1], cx = q[c], cy = q[c + 1];
    const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    if (area === 0) return;
    const x0 = Math.max(0, Math.floor(Math.min(ax, bx, cx))), x1 = Math.min(width - 1, Math.ceil(Math.max(ax, bx, cx)));
    const y0 = Math.max(0, Math.floor(Math.min(ay, by, cy))), y1 = Math.min(height - 1, Math.ceil(Math.max(ay, by, cy)));
    const flat = ca === cb && cb === cc, s = 1 / area;
    for (let y = y0; y <= y1; y++) {
      const py = y + 0.5;
      let wa = ((cx - bx) * (py - by) - (cy - by) * (x0 + 0.5 - bx)) * s, wb = ((ax - cx) * (py - cy) - (ay - cy) * (x0 + 0.5 - cx)) * s;
      const da = -(cy - by) * s, db = -(ay - cy) * s;
      for (let x = x0, k = y * width + x0; x <= x1; x++, k++, wa += da, wb += db) {
        const wc = 1 - wa - wb;
        if (wa < 0 || wb < 0 || wc < 0) continue;
        const d = wa * q[a + 2] + wb * q[b + 2] + wc * q[c + 2];
        if (d <= depth[k]) continue;
        depth[k] = d;
        pixels[k] = flat ? ca : rgb(wa * (ca & 255) + wb * (cb & 255) + wc * (cc & 255),
          wa * ((ca >> 8) & 255) + wb * ((cb >> 8) & 255) + wc * ((cc >> 8) & 255),
          wa * ((ca >> 16) & 255) + wb * ((cb >> 16) & 255) + wc * ((cc >> 16) & 255));
      }
    }
  }
  function drawMesh(layer) {
    const q = project(layer.positions, new Float32Array(layer.positions.length)), basis = axes();
    const paint = layer.paints[layer.paint], count = layer.positions.length / 3, lit = new Int32Array(count);
    for (let i = 0; i < count; i++) {
      const [l] = light(layer.normals, 3 * i, basis);
      lit[i] = rgb(paint[3 * i] * l, paint[3 * i + 1] * l, paint[3 * i + 2] * l);
    }
    const t = layer.triangles;
    for (let i = 0; i < t.length; i += 3) triangle(q, 3 * t[i], 3 * t[i + 1], 3 * t[i + 2], lit[t[i]], lit[t[i + 1]], lit[t[i + 2]]);
  }
  function drawDiscs(layer) {
    const [, , back] = axes(), p = layer.positions, rim = new Float32Array(3 * DISC_SIDES), q = new Float32Array(3 * DISC_SIDES);
    for (let i = 0; i < p.length; i += 3) {
      const n = cross([layer.u[i], layer.u[i + 1], layer.u[i + 2]], [layer.v[i], layer.v[i + 1], layer.v[i + 2]]);
      if (dot(n, back) <= 0) continue;
      for (let s = 0; s < DISC_SIDES; s++) {
        const c = Math.cos((2 * Math.PI * s) / DISC_SIDES), m = Math.sin((2 * Math.PI * s) / DISC_SIDES);
        for (let d = 0; d < 3; d++) rim[3 * s + d] = p[i + d] + c * layer.u[i + d] + m * layer.v[i + d];
      }
      project(rim, q);
      const color = rgb(layer.colors[i], layer.colors[i + 1], layer.colors[i + 2]);
      for (let s = 1; s + 1 < DISC_SIDES; s++) triangle(q, 0, 3 * s, 3 * s + 3, color, color, color);
    }
  }
  function dotAt(x, y, d, radius, color) {
    const x0 = Math.max(0, Math.ceil(x - radius - 0.5)), x1 = Math.min(width - 1, Math.floor(x + radius - 0.5));
    const y0 = Math.max(0, Math.ceil(y - radius - 0.5)), y1 = Math.min(height - 1, Math.floor(y + radius - 0.5));
    for (let v = y0; v <= y1; v++) for (let u = x0, k = v * width + x0; u <= x1; u++, k++) {
      const dx = u + 0.5 - x, dy = v + 0.5 - y;
      if (d > depth[k] && dx * dx + dy * dy <= radius * radius) { depth[k] = d; pixels[k] = color; }
    }
  }
  function drawPoints(layer, scale) {
    const q = project(layer.positions, new Float32Array(layer.positions.length), DOT_BIAS), basis = axes(), c = layer.colors;
    for (let i = 0; i < q.length; i += 3) {
      const [l, z] = layer.normals ? light(layer.normals, i, basis) : [1, 1];
      if (z < -0.02) continue; // points of the far side would show through
      dotAt(q[i], q[i + 1], q[i + 2], layer.radius * scale * camera.distance * q[i + 2], rgb(c[i] * l, c[i + 1] * l, c[i + 2] * l));
    }
  }
  function drawLines(layer, scale) {
    const q = project(layer.positions, new Float32Array(layer.positions.length), LINE_BIAS), color = rgb(...layer.color);
    for (let piece = 0; piece + 1 < layer.starts.length; piece++) {
      for (let i = 3 * layer.starts[piece]; i + 3 < 3 * layer.starts[piece + 1]; i += 3) {
        const steps = Math.max(1, Math.ceil(Math.hypot(q[i + 3] - q[i], q[i + 4] - q[i + 1])));
        for (let s = 0; s <= steps; s++) {
          const f = s / steps;
          dotAt(q[i] + f * (q[i + 3] - q[i]), q[i + 1] + f * (q[i + 4] - q[i + 1]), q[i + 2] + f * (q[i + 5] - q[i + 2]), 0.9 * scale, color);
        }
      }
    }
  }
  const painters = { mesh: drawMesh, discs: drawDiscs, points: drawPoints, lines: drawLines };
  function draw(scale) {
    resize(scale);
    for (const layer of layers) if (layer.on) painters[layer.kind](layer, scale);
    context.putImageData(image, 0, 0);
  }
  let asked = 0, settle = 0;
  function redraw() { // coarse while moving, fine at rest
    if (!asked) asked = requestAnimationFrame(() => { asked = 0; draw(1); });
    clearTimeout(settle);
    settle = setTimeout(() => draw(2), 140);
  }

  // --- side panel ----------------------------------------------------------------------------------
  const element = (tag, text, parent) => {
    const made = document.createElement(tag);
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  };
  const legends = [];
  for (const layer of layers) {
    const label = element("label", "", side), box = element("input", "", label);
    box.type = "checkbox"; box.checked = layer.on; box.value = layer.id;
    box.onchange = () => { layer.on = box.checked; showLegends(); redraw(); };
    label.append(layer.name);
    element("span", layer.count.toLocaleString("en"), label);
  }
  const solid = layers.find((layer) => layer.kind === "mesh");
  if (solid) {
    const group = element("fieldset", "", side);
    element("legend", "colour of the solid", group);
    for (const [name, title] of [["plain", "plain"], ["faces", "by face"], ["error", "distance to the truth"]]) {
      if (!(name in solid.paints)) continue;
      const label = element("label", "", group), radio = element("input", "", label);
      radio.type = "radio"; radio.name = "paint"; radio.value = name; radio.checked = name === solid.paint;
      radio.onchange = () => { solid.paint = name; showLegends(); redraw(); };
      label.append(title);
    }
  }
  for (const layer of layers.filter((l) => l.legend)) {
    const block = element("div", "", side);
    const bar = element("div", "", block), ends = element("div", "", block);
    bar.className = "scale"; ends.className = "ends";
    bar.style.background = `linear-gradient(90deg, ${layer.legend.stops.map((c) => `rgb(${c})`).join(",")})`;
    element("span", "0", ends); element("span", layer.name + ", unit lengths", ends); element("span", String(layer.legend.end), ends);
    legends.push([layer, block]);
  }
  function showLegends() {
    for (const [layer, block] of legends) block.hidden = !(layer.on && (layer.kind !== "mesh" || layer.paint === "error"));
  }
  const buttons = element("fieldset", "", side);
  element("legend", "look", buttons);
  const looks = { start: null, front: [-90, 0], right: [0, 0], top: [-90, 89.9], "isometric": [-45, 35.26] };
  for (const [name, angles] of Object.entries(looks)) {
    const button = element("button", name, buttons);
    buttons.append(" ");
    button.onclick = () => {
      camera = start();
      if (angles) [camera.azimuth, camera.elevation] = angles.map((a) => (a * Math.PI) / 180);
      redraw();
    };
  }
  const toggles = [...document.querySelectorAll("#toggles input")], views = document.querySelector("#views");
  for (const box of toggles) { // of the radio buttons one shows, and the change of it hides the others
    box.onchange = () => toggles.forEach((other) => views.classList.toggle("hide-" + other.value, !other.checked));
  }

  // --- pointer and keys ------------------------------------------------------------------------------
  const fingers = new Map();
  function turn(dx, dy) {
    camera.azimuth -= dx * 0.008;
    camera.elevation = Math.max(-1.5706, Math.min(1.5706, camera.elevation + dy * 0.008));
  }
  function move(dx, dy) {
    const s = (2 * camera.distance) / (FOCAL * Math.min(canvas.clientWidth, canvas.clientHeight));
    camera.pan[0] += dx * s; camera.pan[1] -= dy * s;
  }
  const zoomBy = (factor) => { camera.distance = Math.max(0.9, Math.min(12, camera.distance * factor)); };
  canvas.onpointerdown = (e) => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, [e.clientX, e.clientY]); };
  canvas.onpointerup = canvas.onpointercancel = (e) => fingers.delete(e.pointerId);
  canvas.onpointermove = (e) => {
    const before = fingers.get(e.pointerId);
    if (!before) return;
    const dx = e.clientX - before[0], dy = e.clientY - before[1];
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== e.pointerId)[1];
      const gap = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      zoomBy(gap(before) / gap([e.clientX, e.clientY])); move(dx / 2, dy / 2);
    } else if (e.shiftKey || e.buttons === 2) move(dx, dy);
    else turn(dx, dy);
    fingers.set(e.pointerId, [e.clientX, e.clientY]);
    redraw();
  };
  canvas.oncontextmenu = (e) => e.preventDefault();
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); zoomBy(Math.exp(e.deltaY * 0.0012)); redraw(); }, { passive: false });
  canvas.ondblclick = () => { camera = start(); redraw(); };
  canvas.onkeydown = (e) => {
    const moves = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] };
    if (e.key in moves) turn(...moves[e.key]);
    else if (e.key === "+") zoomBy(0.9);
    else if (e.key === "-") zoomBy(1.1);
    else return;
    e.preventDefault(); redraw();
  };
  new ResizeObserver(redraw).observe(canvas);
  for (const name of new URLSearchParams(location.hash.slice(1)).getAll("layer")) { // view.html#layer=points&layer=curves
    for (const box of side.querySelectorAll("input[type=checkbox]")) if (box.value === name) box.click();
  }
  const paint = new URLSearchParams(location.hash.slice(1)).get("paint");
  if (paint) side.querySelector(`input[value="${CSS.escape(paint)}"]`)?.click();
  showLegends();
  draw(2);
})();
