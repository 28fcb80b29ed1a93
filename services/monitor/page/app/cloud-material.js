// Material of the points. The shader colours them by intensity or by depth, so a change costs nothing per point.

import { DataTexture, LinearFilter, ShaderMaterial, Vector2 } from "../vendor/three/three.module.min.js";
import { depthColours } from "./colour-maps.js";

// `position` is in steps of the message, and so is depth, its z.
const VERTEX = `
    attribute float intensity;
    uniform bool byDepth;
    uniform vec2 depths;
    uniform sampler2D colours;
    uniform float pointSize;
    uniform float leastSize;
    varying vec3 tint;

    void main() {
        vec4 inView = modelViewMatrix * vec4(position, 1.0);
        gl_Position = projectionMatrix * inView;
        gl_PointSize = max(leastSize, pointSize / -inView.z);
        float nearness = clamp((depths.y - position.z) / max(1.0, depths.y - depths.x), 0.0, 1.0);
        tint = byDepth ? texture2D(colours, vec2(nearness, 0.5)).rgb : vec3(0.12 + 0.88 * intensity);
    }
`;

const FRAGMENT = `
    varying vec3 tint;

    void main() {
        gl_FragColor = vec4(tint, 1.0);
    }
`;

export function makeCloudMaterial() {
    const uniforms = {
        byDepth: { value: true },
        depths: { value: new Vector2(0, 1) },
        colours: { value: depthTexture() },
        pointSize: { value: 1 },
        leastSize: { value: 1 },
    };
    return new ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms });
}

function depthTexture() {
    const rgba = new Uint8Array(4 * 256).fill(255);
    for (let index = 0; index < 256; index += 1) {
        rgba.set(depthColours.subarray(3 * index, 3 * index + 3), 4 * index);
    }
    const texture = new DataTexture(rgba, 256, 1);
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.needsUpdate = true;
    return texture;
}
