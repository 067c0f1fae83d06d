// Bodies in space that can be turned: no library, nothing fetched. One WebGL context draws all
// views, since a browser allows few; each view is a plain canvas that the drawing is copied to.
(() => {
  'use strict';
  const VERTEX = `#version 300 es
    uniform mat3 turn; uniform vec3 middle; uniform vec3 reach; uniform float lift;
    in vec3 place; in float value; out float v; out vec3 seen;
    void main() {
      seen = turn * (place - middle); v = value;
      gl_Position = vec4(seen.xy / reach.xy, -seen.z / reach.z - lift, 1.0);
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    uniform sampler2D colours; uniform int line; uniform bool sieve;
    in float v; in vec3 seen; out vec4 colour;
    void main() {
      if (line > 0) { colour = vec4(vec3(line == 1 ? 0.1 : 0.42), 1.0); return; }
      ivec2 p = ivec2(gl_FragCoord.xy);
      if (sieve && (p.x % 3 != 0 || p.y % 3 != 0)) discard;
      vec3 n = normalize(cross(dFdx(seen), dFdy(seen)));
      vec3 full = texture(colours, vec2(v * 0.984375 + 0.0078125, 0.5)).rgb;
      colour = vec4(full * (0.8 + 0.2 * abs(n.z)), 1.0);
    }`;
  const holders = [...document.querySelectorAll('.turn')];
  const shared = document.createElement('canvas');
  const gl = holders.length ? shared.getContext('webgl2', {antialias: true, alpha: false}) : null;
  if (!gl) return; // the stills stay
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return;
  gl.useProgram(program);
  const at = name => gl.getUniformLocation(program, name);
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
  const buffer = (kind, content) => {
    const made = gl.createBuffer();
    gl.bindBuffer(kind, made);
    gl.bufferData(kind, content, gl.STATIC_DRAW);
    return made;
  };
  const times = (a, b) => [0, 1, 2].flatMap(i => [0, 1, 2].map(
    j => a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j]));
  const states = new Map(); // the views of one figure turn together

  function view(holder) {
    const head = JSON.parse(holder.dataset.head), figure = holder.closest('figure');
    if (!states.has(figure)) states.set(figure, {views: [], turn: head.axes, zoom: 1, sieve: false});
    const state = states.get(figure), image = holder.querySelector('img');
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    const packed = new Uint16Array(bytes(holder.dataset.vertices));
    const numbers = new Float32Array(packed.length);
    packed.forEach((q, i) => {
      const k = i % 4;
      numbers[i] = k < 3 ? head.low[k] + q / 65535 * head.span[k] : q / 65535;
    });
    buffer(gl.ARRAY_BUFFER, numbers);
    for (const [name, size, offset] of [['place', 3, 0], ['value', 1, 12]]) {
      const where = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, size, gl.FLOAT, false, 16, offset);
    }
    const surface = buffer(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(bytes(holder.dataset.triangles)));
    const lines = buffer(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(bytes(holder.dataset.edges)));
    const colours = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, colours);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 64, 1, 0, gl.RGB, gl.UNSIGNED_BYTE,
      new Uint8Array(bytes(holder.dataset.colours)));
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    const canvas = document.createElement('canvas');
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', image.alt + ' Can be turned by arrow keys.');
    canvas.style.aspectRatio = head.size[0] + ' / ' + head.size[1];
    holder.append(canvas);
    holder.classList.add('live');

    const draw = () => {
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      const w = Math.max(1, Math.round(canvas.clientWidth * ratio));
      const h = Math.max(1, Math.round(w * head.size[1] / head.size[0]));
      canvas.width = shared.width = w;
      canvas.height = shared.height = h;
      gl.viewport(0, 0, w, h);
      gl.clearColor(1, 1, 1, 1);
      gl.enable(gl.DEPTH_TEST);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.bindVertexArray(vao);
      gl.bindTexture(gl.TEXTURE_2D, colours);
      gl.uniformMatrix3fv(at('turn'), true, state.turn);
      gl.uniform3fv(at('middle'), head.middle);
      gl.uniform3f(at('reach'), head.half[0] / state.zoom, head.half[1] / state.zoom, head.depth);
      const part = (from, count, sieve) => {
        gl.uniform1i(at('sieve'), sieve ? 1 : 0);
        if (count) gl.drawElements(gl.TRIANGLES, 3 * count, gl.UNSIGNED_INT, 12 * from);
      };
      gl.uniform1i(at('line'), 0);
      gl.uniform1f(at('lift'), 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, surface);
      part(0, head.outer, state.sieve);
      part(head.outer, head.triangles - head.outer, false);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, lines);
      const strokes = (kind, from, count, lift) => {
        gl.uniform1i(at('line'), kind);
        gl.uniform1f(at('lift'), lift);
        if (count) gl.drawElements(gl.LINES, 2 * count, gl.UNSIGNED_INT, 8 * from);
      };
      strokes(2, head.outline, head.edges - head.outline, 0.001);
      strokes(1, 0, head.outline, 0.002);
      canvas.getContext('2d').drawImage(shared, 0, 0);
    };
    const redraw = () => state.views.forEach(one => requestAnimationFrame(one));
    const turn = (right, down) => {
      const [a, b, c, d] = [Math.cos(right), Math.sin(right), Math.cos(down), Math.sin(down)];
      state.turn = times([1, 0, 0, 0, c, -d, 0, d, c], times([a, 0, b, 0, 1, 0, -b, 0, a], state.turn));
      redraw();
    };
    const zoom = factor => {
      state.zoom = Math.min(40, Math.max(0.4, state.zoom * factor));
      redraw();
    };
    const fingers = new Map();
    canvas.addEventListener('pointerdown', e => {
      fingers.set(e.pointerId, [e.clientX, e.clientY]);
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener('pointermove', e => {
      const before = fingers.get(e.pointerId);
      if (!before) return;
      const other = [...fingers].find(([id]) => id !== e.pointerId);
      const now = [e.clientX, e.clientY], gap = p => Math.hypot(p[0] - other[1][0], p[1] - other[1][1]);
      if (other) zoom((gap(now) + 1) / (gap(before) + 1));
      else turn((now[0] - before[0]) * 0.01, (now[1] - before[1]) * 0.01);
      fingers.set(e.pointerId, now);
    });
    for (const end of ['pointerup', 'pointercancel']) {
      canvas.addEventListener(end, e => fingers.delete(e.pointerId));
    }
    canvas.addEventListener('wheel', e => {
      if (document.activeElement !== canvas) return; // the page scrolls
      e.preventDefault();
      zoom(Math.exp(-e.deltaY * 0.0015));
    }, {passive: false});
    canvas.addEventListener('keydown', e => {
      const step = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1]};
      if (step[e.key]) turn(...step[e.key]);
      else if (e.key === '+' || e.key === '-') zoom(e.key === '+' ? 1.15 : 1 / 1.15);
      else if (e.key === '0') Object.assign(state, {turn: head.axes, zoom: 1}), redraw();
      else return;
      e.preventDefault();
    });
    if (!state.views.length) {
      const box = document.createElement('input');
      box.type = 'checkbox';
      box.addEventListener('change', () => { state.sieve = box.checked; redraw(); });
      const label = document.createElement('label');
      label.className = 'see-through';
      label.append(box, ' see through to the cuts');
      figure.append(label);
    }
    state.views.push(draw);
    new ResizeObserver(draw).observe(canvas);
    draw();
  }
  holders.forEach(view);
})();
