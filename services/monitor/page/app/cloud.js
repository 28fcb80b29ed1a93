// The live cloud or the model, seen from camera 1 until the user turns it. It is drawn when a cloud arrives or the view
// changes. The scene is in metres in the frame of camera 1, rotated by half a turn about x, since three.js looks along
// −z with y up.

import {
    BufferAttribute,
    BufferGeometry,
    PerspectiveCamera,
    Points,
    Scene,
    Vector3,
    WebGLRenderer,
} from "../vendor/three/three.module.min.js";
import { OrbitControls } from "../vendor/three/OrbitControls.js";
import { extentOf } from "./cloud-extent.js";
import { makeCloudMaterial } from "./cloud-material.js";
import { gradientOf, depthColours } from "./colour-maps.js";
import { oncePerFrame } from "./drawing.js";
import { byId, setText } from "./elements.js";
import { fixed, plural } from "./format.js";
import { markLive } from "./panels.js";

// Steps of the keyboard.
const TURN_RAD = Math.PI / 24;
const ZOOM = 0.9;

/** Makes the view. Returns null if the browser has no WebGL 2; the panel then says so. */
export function makeCloudView() {
    const canvas = byId("cloud-canvas");
    // preserveDrawingBuffer: the drawing can be read from the canvas after it was shown.
    const context = canvas.getContext("webgl2", { alpha: true, antialias: true, preserveDrawingBuffer: true });
    if (context === null) {
        setText(byId("cloud-empty"), "This browser has no 3D graphics (WebGL 2), so the cloud cannot be shown.");
        return null;
    }
    return new CloudView(canvas, context);
}

class CloudView {
    #canvas;
    #renderer;
    #scene = new Scene();
    #camera = new PerspectiveCamera(35, 1, 0.001, 50);
    #points = new Points(new BufferGeometry(), makeCloudMaterial());
    #controls;
    // Centre, radius and point spacing in metres: of the last cloud, and of the cloud that the view was fitted to.
    #newest = null;
    #fitted = null;
    // Whether the user has changed the view since.
    #touched = false;
    // The message that is not drawn yet.
    #undrawn = null;
    #draw = oncePerFrame(() => this.#render());

    constructor(canvas, context) {
        this.#canvas = canvas;
        this.#renderer = new WebGLRenderer({ canvas, context });
        this.#renderer.setClearColor(0x000000, 0);
        this.#points.frustumCulled = false;
        this.#points.rotation.x = Math.PI;
        this.#scene.add(this.#points);
        this.#controls = new OrbitControls(this.#camera, canvas);
        this.#controls.addEventListener("change", this.#draw);
        this.#controls.addEventListener("start", () => {
            this.#touched = true;
        });
        this.#listen();
        new ResizeObserver(() => this.#resize()).observe(canvas.parentElement);
    }

    /** Draws a cloud in the next frame, then confirms it to the server. */
    show(message, reply) {
        this.#undrawn = { id: message.id, reply };
        this.#setPoints(message);
        this.#describe(message);
        this.#draw();
    }

    /** Shows the progress of a preparation until the first cloud arrives; null if nothing is prepared. */
    showPreparation(preparation) {
        setText(byId("cloud-empty"), preparation ?? "No cloud yet");
    }

    /** Fits the view to the next cloud, since that shows something else. */
    refitNext() {
        this.#fitted = null;
        this.#touched = false;
    }

    #listen() {
        const canvas = this.#canvas;
        canvas.addEventListener("webglcontextrestored", this.#draw);
        canvas.addEventListener("keydown", (event) => this.#handleKey(event));
        // The wheel scrolls the page until the user clicks the cloud.
        this.#controls.enableZoom = false;
        canvas.addEventListener("pointerdown", () => canvas.focus({ preventScroll: true }), { capture: true });
        canvas.addEventListener("focus", () => (this.#controls.enableZoom = true));
        canvas.addEventListener("blur", () => (this.#controls.enableZoom = false));
        byId("cloud-colour").addEventListener("change", () => this.#recolour());
        byId("cloud-reset").addEventListener("click", () => this.#reset());
        byId("cloud-scale").style.background = gradientOf(depthColours);
        this.#recolour();
    }

    #handleKey(event) {
        const actions = {
            ArrowLeft: () => this.#controls.rotateLeft(TURN_RAD),
            ArrowRight: () => this.#controls.rotateLeft(-TURN_RAD),
            ArrowUp: () => this.#controls.rotateUp(TURN_RAD),
            ArrowDown: () => this.#controls.rotateUp(-TURN_RAD),
            "+": () => this.#controls.dollyIn(ZOOM),
            "=": () => this.#controls.dollyIn(ZOOM),
            "-": () => this.#controls.dollyOut(ZOOM),
            r: () => this.#reset(),
            R: () => this.#reset(),
        };
        const action = actions[event.key];
        if (action && !event.ctrlKey && !event.metaKey && !event.altKey) {
            event.preventDefault();
            this.#touched = true;
            action();
        }
    }

    #recolour() {
        const byDepth = byId("cloud-colour").value === "depth";
        this.#points.material.uniforms.byDepth.value = byDepth;
        byId("cloud-legend").hidden = !byDepth;
        this.#draw();
    }

    #setPoints({ positions, intensities, centre_m: centre, step_m: step }) {
        fillGeometry(this.#points.geometry, positions, intensities);
        this.#points.scale.setScalar(step);
        this.#points.position.set(centre[0], -centre[1], -centre[2]);
        const extent = extentOf(positions);
        if (extent) {
            this.#useExtent(extent, centre, step, intensities.length);
        }
    }

    // Colours and point size always follow the cloud. The view follows it only while the user has not changed it.
    #useExtent(extent, centre, step, points) {
        const [x, y, z] = extent;
        this.#points.material.uniforms.depths.value.set(z[0], z[1]);
        const [near, far] = z.map((value) => 1000 * (centre[2] + step * value));
        setText(byId("cloud-near"), `${fixed(near)} mm`);
        setText(byId("cloud-far"), `${fixed(far)} mm`);

        const middle = extent.map(([least, greatest], axis) => centre[axis] + (step * (least + greatest)) / 2);
        const sizes = extent.map(([least, greatest]) => step * (greatest - least));
        const target = new Vector3(middle[0], -middle[1], -middle[2]);
        const radius = Math.max(Math.hypot(...sizes) / 2, 1e-4);
        const spacing = Math.sqrt((Math.max(sizes[0], radius / 10) * Math.max(sizes[1], radius / 10)) / points);
        this.#newest = { target, radius, spacing };
        const strayed = this.#fitted && target.distanceTo(this.#fitted.target) > this.#fitted.radius / 2;
        if (!this.#fitted || (strayed && !this.#touched)) {
            this.#reset();
        }
    }

    #reset() {
        this.#fitted = this.#newest;
        this.#touched = false;
        if (this.#fitted) {
            this.#fit();
        }
    }

    #fit() {
        const { target, radius } = this.#fitted;
        const half = Math.tan((this.#camera.fov * Math.PI) / 360);
        const distance = (0.95 * radius) / (half * Math.min(1, this.#camera.aspect));
        const towards = target.clone().normalize();
        this.#camera.position.copy(target).addScaledVector(towards, -distance);
        this.#camera.near = distance / 50;
        this.#camera.far = distance * 20;
        this.#camera.updateProjectionMatrix();
        this.#controls.target.copy(target);
        this.#controls.minDistance = distance / 20;
        this.#controls.maxDistance = distance * 8;
        this.#controls.update();
        this.#draw();
    }

    #resize() {
        const { clientWidth: width, clientHeight: height } = this.#canvas.parentElement;
        this.#renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
        this.#renderer.setSize(width, height, false);
        this.#camera.aspect = width / Math.max(1, height);
        this.#camera.updateProjectionMatrix();
        this.#draw();
    }

    #render() {
        const uniforms = this.#points.material.uniforms;
        const ratio = this.#renderer.getPixelRatio();
        const half = Math.tan((this.#camera.fov * Math.PI) / 360);
        uniforms.leastSize.value = 1.5 * ratio;
        uniforms.pointSize.value = (1.3 * (this.#fitted?.spacing ?? 0) * this.#canvas.height) / (2 * half);
        this.#renderer.render(this.#scene, this.#camera);
        if (this.#undrawn) {
            markLive("panel-cloud");
            this.#undrawn.reply({ type: "shown", id: this.#undrawn.id });
            this.#undrawn = null;
        }
    }

    #describe({ points, shown }) {
        byId("cloud-empty").hidden = true;
        const part = shown < points ? `, ${fixed(shown)} shown` : "";
        setText(byId("cloud-points"), `${plural(points, "point")}${part}`);
    }
}

// Reuses the buffers on the graphics card while they are large enough.
function fillGeometry(geometry, positions, intensities) {
    const points = intensities.length;
    if (!(geometry.getAttribute("intensity")?.count >= points)) {
        const capacity = Math.ceil(1.25 * points);
        geometry.dispose();
        geometry.setAttribute("position", new BufferAttribute(new Int16Array(3 * capacity), 3));
        geometry.setAttribute("intensity", new BufferAttribute(new Uint8Array(capacity), 1, true));
    }
    for (const [name, values] of [["position", positions], ["intensity", intensities]]) {
        const attribute = geometry.getAttribute(name);
        attribute.array.set(values);
        attribute.needsUpdate = true;
    }
    geometry.setDrawRange(0, points);
}
