// One programme for points and lines.

export const kVertexShader = `#version 300 es
uniform mat4 view_projection;
uniform float point_size;  // device pixels at the target's distance
uniform float target_distance;
in vec3 position;
in vec3 color;
out vec3 shade;
void main() {
  gl_Position = view_projection * vec4(position, 1.0);
  float nearness = target_distance / max(gl_Position.w, 1e-9);
  gl_PointSize = clamp(point_size * sqrt(nearness), 1.0, 4.0 * point_size);
  shade = color;
}`;

export const kFragmentShader = `#version 300 es
precision mediump float;
uniform bool is_round;
in vec3 shade;
out vec4 fragment;
void main() {
  if (is_round && length(gl_PointCoord - 0.5) > 0.5) discard;
  fragment = vec4(shade, 1.0);
}`;

export function compileProgram(gl) {
  const program = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, kVertexShader],
    [gl.FRAGMENT_SHADER, kFragmentShader]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.bindAttribLocation(program, 0, 'position');
  gl.bindAttribLocation(program, 1, 'color');
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) &&
      !gl.isContextLost()) {
    throw new Error(`WebGL programme: ${gl.getProgramInfoLog(program)}`);
  }
  return program;
}
