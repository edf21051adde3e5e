"use strict";
/* The 3D view of shells in their materials, on three.js.

   decodeShells(text, shells)   base64 of positions and triangles -> typed arrays
   createViewer(canvas, data)   draws them; returns what the page's controls call

   Positions are 16-bit counts of data.step mm from data.origin; everything that goes in and out of
   the viewer is in mm of the files. A frame is drawn only when something has changed. */

const CREASE = Math.cos((35 * Math.PI) / 180); // flatter edges are shaded as one smooth face
const SLIVER = 8; // steps of position: a triangle less high than this is turned by their rounding
const FOLD = -Math.cos(2 * Math.atan(1 / SLIVER)); // a flat face that thinning has folded on itself
const MOST_EDGES = 300000; // lines of sharp edges; more would be a grey cloud
const TURN = Math.PI / 24; // a key's step
const FLIGHT_MS = 450;

/* ---------------------------------------------------------------------------------------------
   From base64 to shells. */

function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

function decodeShells(text, shells) {
  const { buffer } = bytesOf(text.trim());
  let at = 0;
  const take = (Kind, count) => {
    const array = new Kind(buffer, at, count);
    at += Math.ceil(array.byteLength / 4) * 4; // everything begins at a multiple of four
    return array;
  };
  return shells.map((shell) => ({
    ...shell,
    points: take(Uint16Array, 3 * shell.points),
    faces: take(shell.wide ? Uint32Array : Uint16Array, 3 * shell.faces),
  }));
}

/* ---------------------------------------------------------------------------------------------
   Normals that are smooth but for creases, and the sharp edges, from what meets at each vertex. */

function faceNormals(points, faces) {
  const normals = new Float32Array(faces.length + faces.length / 3); // x, y, z, area of each
  for (let f = 0, o = 0; f < faces.length; f += 3, o += 4) {
    const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
    const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    const area = Math.sqrt(x * x + y * y + z * z) || 1;
    normals[o] = x / area;
    normals[o + 1] = y / area;
    normals[o + 2] = z / area;
    normals[o + 3] = area;
  }
  return normals;
}

function distance(points, a, b) {
  const x = points[3 * a] - points[3 * b], y = points[3 * a + 1] - points[3 * b + 1];
  const z = points[3 * a + 2] - points[3 * b + 2];
  return Math.sqrt(x * x + y * y + z * z);
}

function cornersByVertex(faces, count) {
  const begin = new Uint32Array(count + 1);
  for (let i = 0; i < faces.length; i++) begin[faces[i] + 1]++;
  for (let v = 0; v < count; v++) begin[v + 1] += begin[v];
  const corners = new Uint32Array(faces.length);
  const next = begin.slice(0, count);
  for (let i = 0; i < faces.length; i++) corners[next[faces[i]]++] = i;
  return { begin, corners };
}

function shade(shell) {
  const { points, faces } = shell;
  const count = points.length / 3;
  const normals = faceNormals(points, faces);
  const { begin, corners } = cornersByVertex(faces, count);
  const index = new Uint32Array(faces.length);
  const vertexOf = [], shaded = [], edges = [];
  for (let v = 0; v < count; v++) {
    const first = vertexOf.length;
    for (let i = begin[v]; i < begin[v + 1]; i++) {
      const corner = corners[i], face = (corner / 3) | 0, n = 4 * face;
      const nx = normals[n], ny = normals[n + 1], nz = normals[n + 2];
      const ahead = faces[corner % 3 === 2 ? corner - 2 : corner + 1];
      let x = 0, y = 0, z = 0, sharp = false;
      for (let j = begin[v]; j < begin[v + 1]; j++) {
        const other = corners[j], m = 4 * ((other / 3) | 0);
        const flat = nx * normals[m] + ny * normals[m + 1] + nz * normals[m + 2];
        if (flat >= CREASE) {
          const area = normals[m + 3];
          x += area * normals[m];
          y += area * normals[m + 1];
          z += area * normals[m + 2];
        } else if (flat > FOLD && v < ahead && faces[other % 3 === 0 ? other + 2 : other - 1] === ahead) {
          // The face on the other side of the edge v-ahead; a sliver along it has no direction.
          const thin = SLIVER * distance(points, v, ahead);
          sharp = sharp || (normals[n + 3] > thin && normals[m + 3] > thin);
        }
      }
      const length = Math.sqrt(x * x + y * y + z * z) || 1;
      const packed =
        ((Math.round((127 * x) / length) & 255) << 16) |
        ((Math.round((127 * y) / length) & 255) << 8) |
        (Math.round((127 * z) / length) & 255);
      let same = first;
      while (same < shaded.length && shaded[same] !== packed) same++;
      if (same === shaded.length) {
        shaded.push(packed);
        vertexOf.push(v);
      }
      index[corner] = same;
      if (sharp && edges.length < 2 * MOST_EDGES) edges.push(v, ahead);
    }
  }
  const position = new Uint16Array(4 * vertexOf.length);
  const normal = new Int8Array(4 * vertexOf.length);
  for (let i = 0; i < vertexOf.length; i++) {
    const v = 3 * vertexOf[i];
    position[4 * i] = points[v];
    position[4 * i + 1] = points[v + 1];
    position[4 * i + 2] = points[v + 2];
    normal[4 * i] = (shaded[i] << 8) >> 24;
    normal[4 * i + 1] = (shaded[i] << 16) >> 24;
    normal[4 * i + 2] = (shaded[i] << 24) >> 24;
  }
  return { position, normal, index, edges, vertexOf };
}

function boxOf(points) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i++) {
    const k = i % 3;
    if (points[i] < low[k]) low[k] = points[i];
    if (points[i] > high[k]) high[k] = points[i];
  }
  return { low, high };
}

/* ---------------------------------------------------------------------------------------------
   Where a plane cuts a shell: pairs of points, in steps. */

function cutSegments(shell, normal, offset, out) {
  const { points, faces } = shell;
  const count = points.length / 3;
  const side = new Float32Array(count);
  for (let v = 0; v < count; v++) {
    const d = normal[0] * points[3 * v] + normal[1] * points[3 * v + 1] + normal[2] * points[3 * v + 2] - offset;
    side[v] = d === 0 ? 1e-6 : d;
  }
  for (let f = 0; f < faces.length; f += 3) {
    const a = faces[f], b = faces[f + 1], c = faces[f + 2];
    const up = (side[a] > 0) + (side[b] > 0) + (side[c] > 0);
    if (up === 0 || up === 3) continue;
    for (const [p, q] of [[a, b], [b, c], [c, a]]) {
      if (side[p] > 0 === side[q] > 0) continue;
      const t = side[p] / (side[p] - side[q]);
      for (let k = 0; k < 3; k++) out.push(points[3 * p + k] + t * (points[3 * q + k] - points[3 * p + k]));
    }
  }
}

/* ---------------------------------------------------------------------------------------------
   What controls of pages with a viewer share. */

const mm = (value) => (Math.round(100 * value) / 100 + 0).toFixed(2); // never -0.00

function endsAlong({ origin, size }, normal) {
  // Where the part begins and ends along a direction, in mm.
  let low = 0, high = 0;
  normal.forEach((n, k) => {
    const a = n * origin[k], b = n * (origin[k] + size[k]);
    low += Math.min(a, b);
    high += Math.max(a, b);
  });
  return [low, high];
}

function followTheme(viewer) {
  const theme = () => {
    const style = getComputedStyle(document.documentElement);
    viewer.setTheme({
      ink: style.getPropertyValue("--edge").trim(),
      edgeOpacity: Number(style.getPropertyValue("--edge-opacity")),
      faded: style.getPropertyValue("--faded").trim(),
    });
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", theme);
  theme();
}

/* ---------------------------------------------------------------------------------------------
   The viewer. */

function createViewer(canvas, data) {
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, stencil: true });
  renderer.localClippingEnabled = true;
  renderer.setClearColor(0x000000, 0);
  const scene = new THREE.Scene();
  const camera = new THREE.OrthographicCamera();
  camera.up.set(0, 0, 1);
  scene.add(camera);
  scene.add(new THREE.HemisphereLight(0xffffff, 0xb8bcc8, 2.1));
  const lamp = new THREE.DirectionalLight(0xffffff, 1.5);
  lamp.position.set(-0.6, 0.9, 1.2);
  camera.add(lamp, lamp.target);
  lamp.target.position.set(0, 0, -1);

  const middle = new THREE.Vector3(...data.origin).addScaledVector(new THREE.Vector3(...data.size), 0.5);
  const radius = 0.5 * Math.hypot(...data.size) || 1;
  const clip = new THREE.Plane();
  const inSteps = new THREE.Group(); // what is inside counts in steps
  inSteps.scale.setScalar(data.step);
  inSteps.position.set(...data.origin);
  scene.add(inSteps);

  const listeners = [];
  const shells = data.shells.map((shell, number) => build(shell, number));
  const cutLines = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ transparent: true }));
  cutLines.visible = cutLines.frustumCulled = false;
  cutLines.renderOrder = 2 * shells.length + 2;
  inSteps.add(cutLines);
  let plane = null; // {normal, at (mm), flipped}
  let highlighted = null;

  function surfaceOf(shell) {
    // A shell's triangles and sharp edges; coloured by vertex where it has values, 0 to 255.
    const made = shade(shell);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(made.position, 4));
    geometry.setAttribute("normal", new THREE.BufferAttribute(made.normal, 4, true));
    geometry.setIndex(new THREE.BufferAttribute(made.index, 1));
    if (shell.values) {
      const colours = new Float32Array(3 * made.vertexOf.length);
      made.vertexOf.forEach((v, i) => shell.scale[shell.values[v]].toArray(colours, 3 * i));
      geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    }
    const lines = new THREE.BufferGeometry();
    const ends = new Uint16Array((made.edges.length * 4));
    made.edges.forEach((v, i) => ends.set(shell.points.subarray(3 * v, 3 * v + 3), 4 * i));
    lines.setAttribute("position", new THREE.BufferAttribute(ends, 4));
    return { geometry, lines };
  }

  const ghosts = [];

  function ghostOf(number) {
    const { lines } = surfaceOf(data.shells[number]);
    const ghost = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color: 0x808080 }));
    ghost.frustumCulled = false;
    inSteps.add(ghost);
    return ghost;
  }

  function build(shell, number) {
    const colour = new THREE.Color(shell.colour);
    const { geometry, lines } = surfaceOf(shell);
    const body = new THREE.Mesh(
      geometry,
      new THREE.MeshLambertMaterial({
        color: colour, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
      }),
    );
    const edges = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ transparent: true }));
    // Where a ray leaves the clipped shell more often than it enters, it has met the section.
    const counting = (sideShown, operation) =>
      new THREE.Mesh(
        geometry,
        new THREE.MeshBasicMaterial({
          side: sideShown, colorWrite: false, depthWrite: false, depthTest: false, clippingPlanes: [clip],
          stencilWrite: true, stencilFunc: THREE.AlwaysStencilFunc,
          stencilFail: operation, stencilZFail: operation, stencilZPass: operation,
        }),
      );
    const cap = new THREE.Mesh(
      new THREE.PlaneGeometry(6 * radius, 6 * radius),
      new THREE.MeshBasicMaterial({
        color: colour, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
        stencilWrite: true, stencilRef: 0, stencilFunc: THREE.NotEqualStencilFunc,
        stencilFail: THREE.ZeroStencilOp, stencilZFail: THREE.ZeroStencilOp, stencilZPass: THREE.ZeroStencilOp,
      }),
    );
    const counters = [
      counting(THREE.BackSide, THREE.IncrementWrapStencilOp),
      counting(THREE.FrontSide, THREE.DecrementWrapStencilOp),
    ];
    for (const item of [body, edges, cap, ...counters]) item.frustumCulled = false;
    for (const item of counters) item.renderOrder = 2 * number + 1;
    cap.renderOrder = 2 * number + 2;
    cap.onAfterRender = () => renderer.clearStencil();
    inSteps.add(body, edges, ...counters);
    scene.add(cap);
    return { ...shell, ...boxOf(shell.points), colour, body, edges, cap, counters, shown: true };
  }

  /* What is drawn. */

  let asked = false, withEdges = true;

  function invalidate() {
    if (!asked) {
      asked = true;
      requestAnimationFrame(draw);
    }
  }

  function draw() {
    asked = false;
    const depth = camera.position.distanceTo(middle);
    camera.near = depth - 3 * radius;
    camera.far = depth + 3 * radius;
    camera.updateProjectionMatrix();
    renderer.render(scene, camera);
    for (const listener of listeners) listener();
  }

  function reach(shell) {
    // How far a shell's box goes along the plane's normal, in mm.
    const { normal } = plane;
    let low = 0, high = 0;
    for (let k = 0; k < 3; k++) {
      const a = normal[k] * (data.origin[k] + data.step * shell.low[k]);
      const b = normal[k] * (data.origin[k] + data.step * shell.high[k]);
      low += Math.min(a, b);
      high += Math.max(a, b);
    }
    return [low, high];
  }

  function arrange() {
    const segments = [];
    if (plane) {
      const sign = plane.flipped ? 1 : -1;
      clip.normal.set(...plane.normal).multiplyScalar(sign);
      clip.constant = -sign * plane.at;
    }
    for (const shell of shells) {
      const { body, edges, cap, counters } = shell;
      const [low, high] = plane ? reach(shell) : [0, 0];
      const gone = plane && (plane.flipped ? high <= plane.at : low >= plane.at);
      const cut = plane && low < plane.at && plane.at < high;
      body.visible = shell.shown && !gone;
      edges.visible = body.visible && withEdges;
      body.material.clippingPlanes = edges.material.clippingPlanes = cut ? [clip] : null;
      cap.visible = counters[0].visible = counters[1].visible = Boolean(shell.shown && cut);
      if (cap.visible) {
        cap.position.copy(middle).addScaledVector(clip.normal, -clip.distanceToPoint(middle));
        cap.lookAt(cap.position.clone().add(clip.normal));
        cutSegments(shell, plane.normal, offsetInSteps(), segments);
      }
      const dimmed = highlighted !== null && shells[highlighted] !== shell;
      for (const { material } of [body, cap]) {
        material.color.copy(material.vertexColors ? white : shell.colour);
        if (dimmed) material.color.lerp(pale, 0.82);
      }
    }
    cutLines.visible = segments.length > 0;
    if (cutLines.visible) {
      // A little before the section, so that they are not lost in it.
      cutLines.position.copy(clip.normal).multiplyScalar((-0.001 * radius) / data.step);
      cutLines.geometry.dispose();
      cutLines.geometry = new THREE.BufferGeometry();
      cutLines.geometry.setAttribute("position", new THREE.Float32BufferAttribute(segments, 3));
    }
    invalidate();
  }

  function offsetInSteps() {
    const { normal, at } = plane;
    const there = normal[0] * data.origin[0] + normal[1] * data.origin[1] + normal[2] * data.origin[2];
    return (at - there) / data.step;
  }

  const pale = new THREE.Color(), white = new THREE.Color(1, 1, 1);
  function setTheme({ ink, edgeOpacity, faded }) {
    pale.set(faded);
    for (const { edges } of shells) {
      edges.material.color.set(ink);
      edges.material.opacity = edgeOpacity;
    }
    cutLines.material.color.set(ink);
    cutLines.material.opacity = 0.5 + 0.5 * edgeOpacity;
    arrange();
  }

  /* The camera: orthographic, so that a length is a length wherever it lies. */

  const controls = new THREE.OrbitControls(camera, canvas);
  controls.enableDamping = false;
  controls.zoomToCursor = true;
  controls.minZoom = 0.2;
  controls.maxZoom = 200;
  controls.addEventListener("change", invalidate);
  controls.addEventListener("start", () => (flight = null));
  let flight = null;

  function moveTo(target, direction, zoom) {
    const to = { target, direction: direction.clone().normalize(), zoom };
    if (still.matches) return place(to);
    const offset = camera.position.clone().sub(controls.target).normalize();
    const from = { target: controls.target.clone(), direction: offset, zoom: camera.zoom };
    const begun = performance.now();
    const step = (now) => {
      if (flight !== step) return;
      const t = Math.min(1, Math.max(0, (now - begun) / FLIGHT_MS)), s = t * t * (3 - 2 * t);
      place({
        target: from.target.clone().lerp(to.target, s),
        direction: turned(from.direction, to.direction, s),
        zoom: from.zoom * (to.zoom / from.zoom) ** s,
      });
      if (t < 1) requestAnimationFrame(step);
      else flight = null;
    };
    flight = step;
    requestAnimationFrame(step);
    return undefined;
  }

  function turned(from, to, share) {
    const turn = new THREE.Quaternion().setFromUnitVectors(from, to);
    return from.clone().applyQuaternion(new THREE.Quaternion().slerp(turn, share));
  }

  function place({ target, direction, zoom }) {
    controls.target.copy(target);
    camera.position.copy(target).addScaledVector(direction, 4 * radius);
    camera.zoom = zoom;
    controls.update();
    invalidate();
  }

  function fitting(direction) {
    // The zoom at which the box fills most of the canvas, seen from a direction.
    const back = direction.clone().normalize();
    const across = new THREE.Vector3(0, 0, 1).cross(back);
    if (across.lengthSq() < 1e-6) across.set(1, 0, 0);
    across.normalize();
    const up = back.clone().cross(across);
    const size = (v) => Math.abs(v.x) * data.size[0] + Math.abs(v.y) * data.size[1] + Math.abs(v.z) * data.size[2];
    const width = (camera.right - camera.left) / (size(across) || 1);
    const height = (camera.top - camera.bottom) / (size(up) || 1);
    return 0.86 * Math.min(width, height);
  }

  const VIEWS = {
    corner: [-0.55, -0.8, 0.5], front: [0, -1, 0.0001], side: [1, 0, 0.0001], top: [0, -0.0001, 1],
  };
  function setView(name) {
    const direction = new THREE.Vector3(...VIEWS[name]);
    moveTo(middle.clone(), direction, fitting(direction));
  }

  function flyTo(point, sizeMm) {
    const wide = Math.max(12 * sizeMm, 0.5 * radius);
    const direction = camera.position.clone().sub(controls.target);
    moveTo(new THREE.Vector3(...point), direction, Math.min(camera.right - camera.left, camera.top - camera.bottom) / wide);
  }

  function orbit(about, tilt) {
    const offset = camera.position.clone().sub(controls.target);
    const around = new THREE.Spherical().setFromVector3(new THREE.Vector3(offset.x, offset.z, -offset.y));
    around.theta += about;
    around.phi = Math.min(Math.PI - 0.01, Math.max(0.01, around.phi + tilt));
    const to = new THREE.Vector3().setFromSpherical(around);
    place({ target: controls.target.clone(), direction: new THREE.Vector3(to.x, -to.z, to.y).normalize(), zoom: camera.zoom });
  }

  function pan(right, up) {
    const e = camera.matrix.elements, step = (0.06 * (camera.right - camera.left)) / camera.zoom;
    const shift = new THREE.Vector3(e[0], e[1], e[2]).multiplyScalar(right * step);
    shift.add(new THREE.Vector3(e[4], e[5], e[6]).multiplyScalar(up * step));
    camera.position.add(shift);
    controls.target.add(shift);
    controls.update();
    invalidate();
  }

  function zoomBy(factor) {
    camera.zoom = Math.min(controls.maxZoom, Math.max(controls.minZoom, camera.zoom * factor));
    invalidate();
  }

  const KEYS = {
    ArrowLeft: (e) => (e.shiftKey ? pan(-1, 0) : orbit(-TURN, 0)),
    ArrowRight: (e) => (e.shiftKey ? pan(1, 0) : orbit(TURN, 0)),
    ArrowUp: (e) => (e.shiftKey ? pan(0, 1) : orbit(0, -TURN)),
    ArrowDown: (e) => (e.shiftKey ? pan(0, -1) : orbit(0, TURN)),
    "+": () => zoomBy(1.15), "=": () => zoomBy(1.15), "-": () => zoomBy(1 / 1.15), _: () => zoomBy(1 / 1.15),
    0: () => setView("corner"), Home: () => setView("corner"),
  };
  canvas.addEventListener("keydown", (event) => {
    const act = KEYS[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    act(event);
  });

  function resize() {
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!width || !height) return;
    const first = camera.userData.sized === undefined;
    renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    renderer.setSize(width, height, false);
    const tall = radius, wide = (tall * width) / height;
    Object.assign(camera, { left: -wide, right: wide, top: tall, bottom: -tall });
    camera.userData.sized = true;
    if (first) {
      const direction = new THREE.Vector3(...VIEWS.corner);
      camera.updateProjectionMatrix();
      place({ target: middle.clone(), direction: direction.normalize(), zoom: fitting(direction) });
    }
    invalidate();
  }

  /* What lies under the pointer: material and place. */

  function pick(x, y) {
    const ndc = [(2 * x) / canvas.clientWidth - 1, 1 - (2 * y) / canvas.clientHeight];
    const from = new THREE.Vector3(ndc[0], ndc[1], -1).unproject(camera);
    const way = new THREE.Vector3(0, 0, -1).transformDirection(camera.matrixWorld);
    const o = from.clone().sub(inSteps.position).divideScalar(data.step);
    const atPlane = plane ? -clip.distanceToPoint(from) / clip.normal.dot(way) / data.step : NaN;
    let best = null, near = Infinity, face = null;
    for (const [number, shell] of shells.entries()) {
      if (!shell.shown) continue;
      let turns = 0; // how often the plane's point lies inside
      for (const [t, outwards, f] of hits(shell, o, way)) {
        if (t > atPlane) turns += outwards;
        const kept = !plane || clip.distanceToPoint(from.clone().addScaledVector(way, t * data.step)) >= 0;
        if (kept && t > 0 && t < near) [near, best, face] = [t, number, f];
      }
      if (turns > 0 && atPlane > 0 && atPlane < near && clip.normal.dot(way) > 0) {
        [near, best, face] = [atPlane, number, null]; // the section itself
      }
    }
    if (best === null) return null;
    const place = from.addScaledVector(way, near * data.step);
    return { shell: best, face, place: [place.x, place.y, place.z] };
  }

  function* hits({ points, faces, low, high }, o, way) {
    const d = [way.x, way.y, way.z], p = [o.x, o.y, o.z];
    let enter = -Infinity, leave = Infinity;
    for (let k = 0; k < 3; k++) {
      const a = (low[k] - p[k]) / d[k], b = (high[k] - p[k]) / d[k];
      enter = Math.max(enter, Math.min(a, b));
      leave = Math.min(leave, Math.max(a, b));
    }
    if (!(enter <= leave)) return;
    for (let f = 0; f < faces.length; f += 3) {
      const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
      const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
      const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
      const hx = d[1] * vz - d[2] * vy, hy = d[2] * vx - d[0] * vz, hz = d[0] * vy - d[1] * vx;
      const det = ux * hx + uy * hy + uz * hz; // above 0 where the ray meets the front
      if (Math.abs(det) < 1e-9) continue;
      const sx = p[0] - points[a], sy = p[1] - points[a + 1], sz = p[2] - points[a + 2];
      const u = (sx * hx + sy * hy + sz * hz) / det;
      if (u < 0 || u > 1) continue;
      const qx = sy * uz - sz * uy, qy = sz * ux - sx * uz, qz = sx * uy - sy * ux;
      const v = (d[0] * qx + d[1] * qy + d[2] * qz) / det;
      if (v < 0 || u + v > 1) continue;
      yield [(vx * qx + vy * qy + vz * qz) / det, det > 0 ? -1 : 1, f];
    }
  }

  function project(point) {
    const at = new THREE.Vector3(...point).project(camera);
    return [0.5 * (at.x + 1) * canvas.clientWidth, 0.5 * (1 - at.y) * canvas.clientHeight];
  }

  function axesOnScreen() {
    // Where x, y and z point: right and up, each with its depth towards the eye.
    const e = camera.matrixWorld.elements;
    return [0, 1, 2].map((k) => [e[k], e[4 + k], e[8 + k]]);
  }

  new ResizeObserver(resize).observe(canvas);
  resize();
  arrange();

  return {
    draw, flyTo, pick, project, setView, setTheme, zoomBy, axesOnScreen,
    onFrame: (listener) => listeners.push(listener),
    // Whether the eye is on the side that a direction points to.
    faces: (n) => n.reduce((sum, v, k) => sum + v * (camera.position.getComponent(k) - controls.target.getComponent(k)), 0) > 0,
    isCutAway: (p) => plane !== null && clip.distanceToPoint(new THREE.Vector3(...p)) < 0,
    mmPerPixel: () => (camera.top - camera.bottom) / camera.zoom / canvas.clientHeight,
    camera: () => ({ position: camera.position.toArray(), target: controls.target.toArray(), zoom: camera.zoom }),
    // How the part is looked at, beside its middle, so that another viewer may look at its own alike.
    look() {
      const direction = camera.position.clone().sub(controls.target).normalize();
      const offset = controls.target.clone().sub(middle);
      return { direction: direction.toArray(), offset: offset.toArray(), mmPerPixel: this.mmPerPixel() };
    },
    setLook({ direction, offset, mmPerPixel }) {
      flight = null;
      const zoom = (camera.top - camera.bottom) / mmPerPixel / canvas.clientHeight;
      place({ target: middle.clone().add(new THREE.Vector3(...offset)), direction: new THREE.Vector3(...direction), zoom });
    },
    setShown(number, value) { shells[number].shown = value; arrange(); },
    setHighlight(number) {
      if (number === highlighted) return;
      highlighted = number;
      arrange();
    },
    setEdges(value) { withEdges = value; arrange(); },
    // Show a shell with other points, coloured by a value a vertex on a scale of 256 colours.
    setFrame(number, { points, values, scale }) {
      const shell = shells[number];
      const { geometry, lines } = surfaceOf({ ...shell, points, values, scale });
      for (const item of [shell.body, ...shell.counters]) item.geometry = geometry;
      shell.edges.geometry.dispose();
      shell.edges.geometry = lines;
      shell.body.material.vertexColors = shell.body.material.needsUpdate = true;
      Object.assign(shell, { points, values }, boxOf(points));
      arrange();
    },
    // The sharp edges of a shell as it was at first, beside what it has become.
    setGhost(number, value) {
      ghosts[number] ??= ghostOf(number);
      ghosts[number].visible = value;
      invalidate();
    },
    setClip(normal, at, flipped) { plane = normal && { normal, at, flipped }; arrange(); },
  };
}
