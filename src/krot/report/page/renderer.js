// Draws batches of coloured points and lines. All a batch costs per frame is
// one draw call.

import { compileProgram } from './shaders.js';

export class Renderer {
  // `gl`: a WebGL 2 context.
  constructor(gl) {
    this.gl = gl;
    this.program = compileProgram(gl);
    this.uniforms = Object.fromEntries(
      ['view_projection', 'point_size', 'target_distance', 'is_round']
        .map((name) => [name, gl.getUniformLocation(this.program, name)]));
    gl.enable(gl.DEPTH_TEST);
  }

  // `xyz`: float32, three per vertex; `mode`: gl.POINTS or gl.LINES.
  createBatch(mode, xyz) {
    const { gl } = this;
    const batch = {
      mode,
      count: xyz.length / 3,
      array: gl.createVertexArray(),
      positions: gl.createBuffer(),
      colors: gl.createBuffer(),
    };
    gl.bindVertexArray(batch.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, batch.positions);
    gl.bufferData(gl.ARRAY_BUFFER, xyz, gl.STATIC_DRAW);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.enableVertexAttribArray(0);
    gl.bindBuffer(gl.ARRAY_BUFFER, batch.colors);
    gl.vertexAttribPointer(1, 3, gl.UNSIGNED_BYTE, true, 0, 0);
    gl.enableVertexAttribArray(1);
    return batch;
  }

  // `rgb`: three bytes per vertex.
  setColors(batch, rgb) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, batch.colors);
    gl.bufferData(gl.ARRAY_BUFFER, rgb, gl.STATIC_DRAW);
  }

  deleteBatch(batch) {
    const { gl } = this;
    gl.deleteVertexArray(batch.array);
    gl.deleteBuffer(batch.positions);
    gl.deleteBuffer(batch.colors);
  }

  // A batch may have a `pointSize` of its own, in device pixels.
  draw(batches, { viewProjection, targetDistance, pointSize }) {
    const { gl, uniforms } = this;
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(uniforms.view_projection, false,
      new Float32Array(viewProjection));
    gl.uniform1f(uniforms.target_distance, targetDistance);
    for (const batch of batches) {
      gl.uniform1f(uniforms.point_size, batch.pointSize ?? pointSize);
      gl.uniform1i(uniforms.is_round, batch.mode === gl.POINTS ? 1 : 0);
      gl.bindVertexArray(batch.array);
      gl.drawArrays(batch.mode, 0, batch.count);
    }
  }
}
