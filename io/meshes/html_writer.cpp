#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "io/files/atomic_file.h"
#include "io/files/json_text.h"
#include "io/meshes/mesh_io.h"

namespace felt {
namespace {

/// The page before and after the data. WebGL 2 and no library: it works from a file, without a network.
constexpr const char* kHead = R"html(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="feltmap">
<style>
html, body { margin: 0; height: 100%; background: #20242a; color: #e8e8e8; font: 14px system-ui, sans-serif; overflow: hidden }
canvas { width: 100%; height: 100%; display: block; touch-action: none; cursor: grab }
#bar { position: fixed; left: 12px; top: 12px; display: flex; gap: 12px; align-items: center; flex-wrap: wrap;
  background: #0009; padding: 8px 12px; border-radius: 8px }
#help { position: fixed; left: 12px; bottom: 12px; opacity: .7 }
button, select { font: inherit }
</style>
)html";

constexpr const char* kViewer = R"html(<canvas id="view"></canvas>
<div id="bar"><b id="title"></b><span id="size"></span>
<label>show <select id="shade"><option value="0">colour</option><option value="1">shaded colour</option><option value="2">shape</option><option value="3">normals</option></select></label>
<label>up <select id="up"><option>+x</option><option>-x</option><option>+y</option><option>-y</option><option>+z</option><option>-z</option></select></label>
<button id="home">whole map</button></div>
<div id="help">drag: turn &nbsp; right button, shift or two fingers: move &nbsp; wheel or pinch: nearer, farther</div>
<script>
'use strict';
const scene = JSON.parse(document.getElementById('scene').textContent);
const element = id => document.getElementById(id);
function bytes(id) {
  const text = atob(element(id).textContent);
  const out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) out[i] = text.charCodeAt(i);
  return out.buffer;
}
element('title').textContent = scene.title;
element('size').textContent = scene.vertices.toLocaleString() + ' vertices, ' + scene.triangles.toLocaleString() + ' triangles';
const canvas = element('view');
const gl = canvas.getContext('webgl2', {antialias: true});
if (!gl) element('help').textContent = 'This browser has no WebGL 2.';

const vertexSource = `#version 300 es
uniform mat4 projection; uniform mat4 view; uniform vec3 low; uniform vec3 extent; uniform float pointSize;
layout(location = 0) in vec3 position; layout(location = 1) in vec3 normal; layout(location = 2) in vec4 color;
out vec3 n; out vec3 c; out vec3 toEye;
void main() {
  vec4 p = view * vec4(low + position * extent, 1.0);
  n = normal; c = color.rgb; toEye = -p.xyz;
  gl_Position = projection * p; gl_PointSize = pointSize;
}`;
const fragmentSource = `#version 300 es
precision highp float;
uniform int shade; uniform mat4 view;
in vec3 n; in vec3 c; in vec3 toEye; out vec4 result;
void main() {
  float light = 0.35 + 0.65 * abs(dot(normalize(mat3(view) * n + vec3(0.0, 0.0, 1e-6)), normalize(toEye)));
  vec3 shown = shade == 3 ? 0.5 + 0.5 * normalize(n + vec3(0.0, 0.0, 1e-6)) : shade == 2 ? vec3(0.85) * light : shade == 1 ? c * light : c;
  result = vec4(shown, 1.0);
}`;
function shader(kind, source) {
  const s = gl.createShader(kind);
  gl.shaderSource(s, source); gl.compileShader(s);
  if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
  return s;
}
const program = gl.createProgram();
gl.attachShader(program, shader(gl.VERTEX_SHADER, vertexSource));
gl.attachShader(program, shader(gl.FRAGMENT_SHADER, fragmentSource));
gl.linkProgram(program);
gl.useProgram(program);
const place = name => gl.getUniformLocation(program, name);
function attribute(location, id, size, type, stride) {
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, bytes(id), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(location);
  gl.vertexAttribPointer(location, size, type, true, stride, 0);
}
attribute(0, 'positions', 3, gl.UNSIGNED_SHORT, 8);
attribute(1, 'normals', 3, gl.BYTE, 4);
attribute(2, 'colors', 4, gl.UNSIGNED_BYTE, 4);
if (scene.triangles) {
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, bytes('triangles'), gl.STATIC_DRAW);
}
const extent = scene.high.map((h, i) => h - scene.low[i]);
gl.uniform3fv(place('low'), scene.low);
gl.uniform3fv(place('extent'), extent);
gl.uniform1f(place('pointSize'), 2);
gl.enable(gl.DEPTH_TEST);

const size = Math.max(1e-3, Math.hypot(...extent));
let turn, tilt, distance, target, up = scene.up, asked = false;
function home() {
  turn = 0.7; tilt = 0.6; distance = 1.1 * size;
  target = scene.low.map((l, i) => l + extent[i] / 2);
  draw();
}
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = a => { const l = Math.hypot(...a) || 1; return a.map(x => x / l); };
const plus = (a, b, s) => a.map((x, i) => x + s * b[i]);
/// Right, up and backward directions of the camera in the world.
function axes() {
  const axis = '+x-x+y-y+z-z'.indexOf(up) / 2, z = [0, 0, 0];
  z[axis >> 1] = axis & 1 ? -1 : 1;
  const x = [0, 0, 0]; x[((axis >> 1) + 1) % 3] = 1;
  const y = cross(z, x);
  const level = plus(x.map(v => v * Math.cos(turn)), y, Math.sin(turn));
  const back = plus(level.map(v => v * Math.cos(tilt)), z, Math.sin(tilt));
  const right = unit(cross(z, back));
  return [right, cross(back, right), back];
}
function draw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * ratio; canvas.height = canvas.clientHeight * ratio;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.125, 0.14, 0.165, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const [r, u, b] = axes(), eye = plus(target, b, distance);
    const view = [r[0], u[0], b[0], 0, r[1], u[1], b[1], 0, r[2], u[2], b[2], 0, -dot(r, eye), -dot(u, eye), -dot(b, eye), 1];
    const near = distance / 100, far = distance + 2 * size, f = 1.8, aspect = canvas.width / Math.max(1, canvas.height);
    const projection = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
    gl.uniformMatrix4fv(place('view'), false, view);
    gl.uniformMatrix4fv(place('projection'), false, projection);
    gl.uniform1i(place('shade'), Number(element('shade').value));
    if (scene.triangles) gl.drawElements(gl.TRIANGLES, 3 * scene.triangles, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(gl.POINTS, 0, scene.vertices);
  });
}
const fingers = new Map();
canvas.addEventListener('pointerdown', e => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, [e.clientX, e.clientY]); });
for (const kind of ['pointerup', 'pointercancel']) canvas.addEventListener(kind, e => fingers.delete(e.pointerId));
canvas.addEventListener('pointermove', e => {
  const old = fingers.get(e.pointerId);
  if (!old) return;
  const dx = (e.clientX - old[0]) / fingers.size, dy = (e.clientY - old[1]) / fingers.size;
  if (fingers.size === 2) {
    const other = [...fingers].find(([id]) => id !== e.pointerId)[1];
    const before = Math.hypot(old[0] - other[0], old[1] - other[1]), after = Math.hypot(e.clientX - other[0], e.clientY - other[1]);
    if (before > 0 && after > 0) distance *= before / after;
  }
  if (fingers.size === 2 || e.buttons & 2 || e.shiftKey) {
    const [r, u] = axes(), scale = distance / canvas.clientHeight;
    target = plus(plus(target, r, -dx * scale), u, dy * scale);
  } else {
    turn -= dx * 0.008; tilt = Math.max(-1.57, Math.min(1.57, tilt + dy * 0.008));
  }
  fingers.set(e.pointerId, [e.clientX, e.clientY]);
  draw();
});
canvas.addEventListener('wheel', e => { e.preventDefault(); distance *= Math.exp(e.deltaY * 0.001); draw(); }, {passive: false});
canvas.addEventListener('contextmenu', e => e.preventDefault());
element('shade').addEventListener('change', draw);
element('shade').value = scene.colored ? '0' : '2';
element('up').value = up;
element('up').addEventListener('change', e => { up = e.target.value; draw(); });
element('home').addEventListener('click', home);
window.addEventListener('resize', draw);
home();
</script>
</body>
</html>
)html";

std::string base64(const void* data, size_t size) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* bytes = static_cast<const uint8_t*>(data);
  std::string text;
  text.reserve((size + 2) / 3 * 4);
  for (size_t i = 0; i < size; i += 3) {
    const size_t left = std::min<size_t>(3, size - i);
    const uint32_t three =
        uint32_t(bytes[i] << 16) | uint32_t(left > 1 ? bytes[i + 1] << 8 : 0) | uint32_t(left > 2 ? bytes[i + 2] : 0);
    for (size_t digit = 0; digit < 4; ++digit) text += digit <= left ? kDigits[three >> (18 - 6 * digit) & 63] : '=';
  }
  return text;
}

/// `<script id=...>` elements hold data that browsers do not run.
std::string data_element(const char* id, const char* type, const std::string& text) {
  return std::string("<script id=\"") + id + "\" type=\"" + type + "\">" + text + "</script>\n";
}

template <typename T>
std::string data_element(const char* id, const std::vector<T>& values) {
  return data_element(id, "text/base64", base64(values.data(), values.size() * sizeof(T)));
}

/// JSON that cannot end the element it stands in.
std::string embedded(const nlohmann::json& json) {
  std::string text = json_text(json);
  for (size_t at = 0; (at = text.find('<', at)) != std::string::npos;) text.replace(at, 1, "\\u003c");
  return text;
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') out += "&amp;";
    if (c == '<') out += "&lt;";
    if (c != '&' && c != '<') out += c;
  }
  return out;
}

}  // namespace

void write_html(const std::filesystem::path& path, const TriangleMesh& mesh, const std::string& title,
                const std::string& up) {
  const size_t n = mesh.positions.size();
  Eigen::Vector3f low = Eigen::Vector3f::Zero(), high = Eigen::Vector3f::Zero();
  for (size_t i = 0; i < n; ++i) {
    low = i == 0 ? mesh.positions[i] : Eigen::Vector3f(low.cwiseMin(mesh.positions[i]));
    high = i == 0 ? mesh.positions[i] : Eigen::Vector3f(high.cwiseMax(mesh.positions[i]));
  }
  constexpr float kLevels = 65535;
  const Eigen::Vector3f scale = kLevels * (high - low).cwiseMax(1e-9f).cwiseInverse();
  // Padded to four numbers: WebGL wants attributes at multiples of four bytes.
  std::vector<std::array<uint16_t, 4>> positions(n);
  std::vector<std::array<int8_t, 4>> normals(n);
  std::vector<std::array<uint8_t, 4>> colors(n, {200, 200, 200, 255});
  for (size_t i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c) {
      positions[i][c] = uint16_t(std::lround(std::min(kLevels, (mesh.positions[i][c] - low[c]) * scale[c])));
      if (!mesh.normals.empty()) normals[i][c] = int8_t(std::lround(127 * std::clamp(mesh.normals[i][c], -1.0f, 1.0f)));
    }
  for (size_t i = 0; i < mesh.colors.size(); ++i)
    colors[i] = {mesh.colors[i].r, mesh.colors[i].g, mesh.colors[i].b, 255};
  const nlohmann::json scene = {{"title", title},
                                {"vertices", n},
                                {"triangles", mesh.triangles.size()},
                                {"low", {low.x(), low.y(), low.z()}},
                                {"high", {high.x(), high.y(), high.z()}},
                                {"up", up},
                                {"colored", !mesh.colors.empty()}};
  static_assert(sizeof(Triangle) == 12);
  AtomicFile file(path);
  file.write(kHead);
  // As JSON has it: without bytes that are no UTF-8.
  file.write("<title>" + escaped(nlohmann::json::parse(json_text(nlohmann::json(title))).get<std::string>()) +
             "</title>\n</head>\n<body>\n");
  file.write(data_element("scene", "application/json", embedded(scene)));
  file.write(data_element("positions", positions));
  file.write(data_element("normals", normals));
  file.write(data_element("colors", colors));
  file.write(data_element("triangles", mesh.triangles));
  file.write(kViewer);
  file.commit();
}

}  // namespace felt
