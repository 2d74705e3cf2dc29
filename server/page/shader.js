// The GLSL programs of the picture: which texel a screen pixel shows, and how linear light becomes 8-bit sRGB.
//
// The view transforms are those of the PNG writer (core/src/encode/view.rs), in the same order of operations: light
// times 2^exposure, the view, clamp to 0..1, the sRGB curve, rounding. Rounding is not left to the graphics driver:
// the formula proposes a code, which is then settled against the same 255 rounding points as the PNG writer compares
// with. NaN is black, as there.

export const VERTEX = `#version 300 es
void main() {
  // One triangle that covers the canvas.
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

const LOOKUP = `
uniform vec2 uOffset;       // device pixels: where the frame's top left corner is, from the canvas's top left
uniform float uScale;       // device pixels per pixel of the frame
uniform float uHeight;      // device pixels: height of the canvas
uniform vec4 uWindow;       // pixels of the frame that are rendered: x0 y0 x1 y1

uniform sampler2D uPicture; // r g b of an element, a = 1 where a tile has been drawn
uniform vec3 uGrid;         // pixels per element, then the element of the frame that is texel (0, 0)
uniform bool uSmooth;       // several elements share a device pixel
uniform sampler2D uOld;     // the same picture at another level, shown until tiles of this level arrive
uniform vec3 uOldGrid;

vec4 element(sampler2D picture, vec3 grid, vec2 pixel, bool smoothly) {
  vec2 at = pixel / grid.x - grid.yz;
  if (!smoothly) {
    return texelFetch(picture, clamp(ivec2(floor(at)), ivec2(0), textureSize(picture, 0) - 1), 0);
  }
  // Elements without a tile are zero with a = 0: dividing by a leaves the mean of those that are there.
  vec4 mean = texture(picture, at / vec2(textureSize(picture, 0)));
  return mean.a > 0.0 ? vec4(mean.rgb / mean.a, 1.0) : vec4(0.0);
}`;

const DISPLAY = `
uniform sampler2D uSteps;   // 255 x 1: the linear values at which the 8-bit sRGB code rises by one
uniform float uGain;        // 2^exposure
uniform int uView;          // 0 standard, 1 filmic, 2 false colour
uniform int uLayer;         // 0 Color, 1 Albedo, 2 Normal
uniform vec3 uBands[14];    // false colour: sRGB codes from 0 to 1 of each stop

float srgb(float v) {
  float curve = v <= 0.0031308 ? v * 12.92 : 1.055 * pow(v, 1.0 / 2.4) - 0.055;
  int code = clamp(int(curve * 255.0 + 0.5), 0, 255);
  if (code < 255 && v >= texelFetch(uSteps, ivec2(code, 0), 0).r) code++;
  if (code > 0 && v < texelFetch(uSteps, ivec2(code - 1, 0), 0).r) code--;
  return float(code) / 255.0;
}

vec3 encode(vec3 display) {
  return vec3(srgb(display.r), srgb(display.g), srgb(display.b));
}

// Stephen Hill's fit of the ACES RRT and sRGB ODT, exposed so that 0.18 keeps its value.
vec3 filmic(vec3 light) {
  const mat3 INPUT = mat3(0.59719, 0.07600, 0.02840, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566, 0.83777);
  const mat3 OUTPUT = mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367, -0.00605, 1.07602);
  vec3 v = max(INPUT * clamp(light * 1.46193, 0.0, 1e6), 0.0);
  vec3 a = v * (v + 0.0245786) - 0.000090537;
  vec3 b = v * (0.983729 * v + 0.432951) + 0.238081;
  return OUTPUT * (a / b);
}

// Luminance in stops from middle grey: bands of one stop, from -7 and below to +6 and above.
vec3 bands(vec3 light) {
  float luminance = dot(light, vec3(0.2126, 0.7152, 0.0722));
  if (luminance <= 0.0) return uBands[0];
  return uBands[int(clamp(floor(log2(luminance / 0.18) + 7.5), 0.0, 13.0))];
}

vec3 display(vec3 light) {
  light = mix(light, vec3(0.0), isnan(light));
  if (uLayer == 1) return encode(clamp(light, 0.0, 1.0));
  if (uLayer == 2) return floor(clamp(light * 0.5 + 0.5, 0.0, 1.0) * 255.0 + 0.5) / 255.0;
  light *= uGain;
  if (uView == 2) return bands(light);
  return encode(clamp(uView == 1 ? filmic(light) : light, 0.0, 1.0));
}`;

export const FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
out vec4 color;
${LOOKUP}
${DISPLAY}
void main() {
  vec2 pixel = (vec2(gl_FragCoord.x, uHeight - gl_FragCoord.y) - uOffset) / uScale;
  color = vec4(0.0);
  if (any(lessThan(pixel, uWindow.xy)) || any(greaterThanEqual(pixel, uWindow.zw))) return;
  vec4 found = element(uPicture, uGrid, pixel, uSmooth);
  if (found.a == 0.0) found = element(uOld, uOldGrid, pixel, uSmooth);
  // Where nothing has been rendered yet the surroundings show through, a little darker.
  color = found.a == 0.0 ? vec4(0.0, 0.0, 0.0, 0.34) : vec4(display(found.rgb), 1.0);
}`;

/** The linear values at which the 8-bit sRGB code rises by one (IEC 61966-2-1), as the PNG writer has them. */
export function roundingPoints() {
  return Float32Array.from({ length: 255 }, (_, code) => {
    const encoded = (code + 0.5) / 255;
    return encoded <= 0.04045 ? encoded / 12.92 : ((encoded + 0.055) / 1.055) ** 2.4;
  });
}

/** False colour: from -7 stops (and darker) to +6 (and brighter), each centred on its stop; middle grey is grey. */
export const BANDS = [
  '#101014', '#1b1238', '#2a1a66', '#27368f', '#1f5ca8', '#2a86a4', '#3aa57e',
  '#8c8c8c', '#8fbf4d', '#d6cf43', '#e8a334', '#e26a2c', '#cf3030', '#ffffff',
];
