"""Other libraries for comparison: runs a named call per request, and answers with its CPU and wall nanoseconds.

Each peer has its fastest reasonable form: 8-bit images without conversion, outputs allocated once where the library
allows it, one thread. The docstrings state what a call computes. None computes a mask of valid pixels, the noise or the
residual.
"""

import json
import logging
import sys
import time
from pathlib import Path

import cv2
import numpy as np
from fringes import Fringes

DISPARITIES = 128

cv2.setNumThreads(1)
cv2.ocl.setUseOpenCL(False)
logging.disable(logging.CRITICAL)


def opencv_decode(images):
    """Phase and modulation of four images, float32: two differences and one conversion to polar coordinates."""
    sine, cosine, modulation, phase = (np.empty(images.shape[1:], np.float32) for _ in range(4))

    def run():
        cv2.subtract(images[3], images[1], dst=sine, dtype=cv2.CV_32F)
        cv2.subtract(images[0], images[2], dst=cosine, dtype=cv2.CV_32F)
        cv2.cartToPolar(cosine, sine, modulation, phase)

    return run


def numpy_decode(images):
    """The same with numpy, float32."""
    sine, cosine, modulation, phase = (np.empty(images.shape[1:], np.float32) for _ in range(4))

    def run():
        np.subtract(images[3], images[1], out=sine, dtype=np.float32)
        np.subtract(images[0], images[2], out=cosine, dtype=np.float32)
        np.arctan2(sine, cosine, out=phase)
        np.hypot(sine, cosine, out=modulation)

    return run


def fringes_decode(images):
    """Mean, modulation and position from one set of four steps with one period, which needs no unwrapping."""
    fringes = Fringes()
    fringes.Y, fringes.X = images.shape[1:]
    fringes.D, fringes.K, fringes.N, fringes.v = 1, 1, len(images), 1
    return lambda: fringes.decode(images, unwrap=False, threads=1)


def rectified_pair(shape):
    """A textured pair with disparities of 25 to 55 pixels, which suits block matching."""
    height, width = shape
    noise = np.random.default_rng(1).integers(0, 256, (height, width + 200)).astype(np.float32)
    texture = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 1.0), None, 0, 255, cv2.NORM_MINMAX)
    v, u = np.mgrid[0:height, 0:width].astype(np.float32)
    disparity = 40 + 15 * np.sin(u / 140) * np.cos(v / 110)
    right = texture[:, :width].astype(np.uint8)
    left = cv2.remap(texture, u - disparity, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT).astype(np.uint8)
    found = stereo("SGBM").compute(left, right) / 16.0
    inside = found[:, 200:] > 0
    error = np.abs(found - disparity)[:, 200:][inside]
    if inside.mean() < 0.9 or np.median(error) > 0.5:
        raise SystemExit("peers: StereoSGBM does not find the disparities of the test pair")
    return left, right


def stereo(mode):
    """Block matching over 128 disparities with common settings."""
    if mode == "BM":
        return cv2.StereoBM_create(DISPARITIES, 15)
    block = 5
    modes = {"SGBM": cv2.STEREO_SGBM_MODE_SGBM, "SGBM_3WAY": cv2.STEREO_SGBM_MODE_SGBM_3WAY}
    smoothness = {"P1": 8 * block**2, "P2": 32 * block**2}
    return cv2.StereoSGBM_create(0, DISPARITIES, block, uniquenessRatio=10, mode=modes[mode], **smoothness)


def undistort_maps(cameras, shape):
    """Rectification maps of both cameras, in float32: the lookup tables of a stereo rig."""
    size = shape[::-1]
    lenses = [(np.array(camera["K"], float), np.array(camera["D"], float)) for camera in cameras]

    def run():
        for matrix, distortion in lenses:
            cv2.initUndistortRectifyMap(matrix, distortion, np.eye(3), matrix, size, cv2.CV_32FC1)

    return run


def main():
    folder = Path(sys.argv[1])
    images = np.load(folder / "images.npy")
    cameras = json.loads((folder / "cameras.json").read_text())
    shape = images.shape[1:]
    makers = {
        "opencv_decode": lambda: opencv_decode(images),
        "numpy_decode": lambda: numpy_decode(images),
        "fringes_decode": lambda: fringes_decode(images),
        "undistort_maps": lambda: undistort_maps(cameras, shape),
    }
    pair = []

    def matcher(mode):
        if not pair:
            pair.extend(rectified_pair(shape))
        found = stereo(mode)
        return lambda: found.compute(*pair)

    for mode in ("SGBM", "SGBM_3WAY", "BM"):
        makers[mode] = lambda mode=mode: matcher(mode)
    made = {}
    for line in sys.stdin:
        command, _, name = line.strip().partition(" ")
        if command == "version":
            print(f"OpenCV {cv2.__version__}, numpy {np.__version__}, Python {sys.version.split()[0]}", flush=True)
            continue
        if name not in made:
            made[name] = makers[name]()
        run = made[name]
        wall, cpu = time.perf_counter_ns(), time.process_time_ns()
        run()
        cpu, wall = time.process_time_ns() - cpu, time.perf_counter_ns() - wall
        print(cpu, wall, flush=True)


if __name__ == "__main__":
    main()
