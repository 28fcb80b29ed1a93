"""Finds the ChArUco board of a simulated calibration with OpenCV, and compares it with `fringeflow board --find`.

Arguments: the command, the folder, columns, rows, square and marker of the board, and its description. Prints one JSON
object: how many corners each found, both root mean square errors against the truth, and the largest distance between
both. All in pixels.
"""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy

command, folder, columns, rows, square, marker, description = sys.argv[1:]
truth = json.loads(Path(folder, "truth.json").read_text())
dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
board = cv2.aruco.CharucoBoard((int(columns), int(rows)), float(square), float(marker), dictionary)
detector = cv2.aruco.CharucoDetector(board)

errors, errors_of_opencv, distances = [], [], []
for number, view in enumerate(truth["views"]):
    for camera in ("cam1", "cam2"):
        image = str(Path(folder, f"view_{number:02}", camera, "000.png"))
        exact = view[f"{camera}_px"]
        found = subprocess.run([command, "board", description, "--find", image, "--json"], capture_output=True, check=True)
        ours = {feature["id"]: (feature["u_px"], feature["v_px"]) for feature in json.loads(found.stdout)["found"]}
        corners, ids, _, _ = detector.detectBoard(cv2.imread(image, cv2.IMREAD_GRAYSCALE))
        theirs = {} if ids is None else dict(zip(ids.ravel().tolist(), corners.reshape(-1, 2).tolist()))
        errors += [numpy.subtract(at, exact[id]) for id, at in ours.items()]
        errors_of_opencv += [numpy.subtract(at, exact[id]) for id, at in theirs.items() if id in ours]
        distances += [numpy.hypot(*numpy.subtract(at, ours[id])) for id, at in theirs.items() if id in ours]


def rms(values):
    return float(numpy.sqrt(numpy.mean(numpy.square(values))))


print(
    json.dumps(
        {
            "found": len(errors),
            "found_by_both": len(distances),
            "rms": rms(errors),
            "rms_of_opencv": rms(errors_of_opencv),
            "largest_distance": float(max(distances)),
        }
    )
)
