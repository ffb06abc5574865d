"""Tables 5.6 and 5.7 of the thesis as they are printed: the L1 by cameras, by a laser, and by one camera.

For each arm the length L in m, the offset A in m and the direction v with the transmission as its length. Table 5.6 is in
the frame of the laser tracker, Table 5.7 in that of the third guideway; there the directions of the third arm and its
offset define the frame, and lengths are 37 and 55 mm off those of Table 5.6, where the text says 5 mm.
"""

ARMS = {
    "5.6": {
        "cameras": (
            (2.041, (1.031, -1.108, 0.512), (-0.040, -1.000, 0.000)),
            (1.805, (-0.236, -1.027, 0.711), (-0.029, -0.997, 0.003)),
            (1.810, (0.968, -1.474, -0.944), (-0.037, -1.002, 0.009)),
        ),
        "laser": (
            (2.048, (1.039, -1.107, 0.519), (-0.046, -0.999, 0.001)),
            (1.810, (-0.236, -1.026, 0.720), (-0.042, -0.999, 0.001)),
            (1.814, (0.975, -1.475, -0.947), (-0.047, -0.999, 0.005)),
        ),
    },
    "5.7": {
        "tape measure": (
            (2.05, (0.04, 0.0, 1.44), (1.0, 0.0, 0.0)),
            (1.82, (0.25, -1.31, 1.46), (1.0, 0.0, 0.0)),
            (1.81, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ),
        "one camera": (
            (2.0440, (-0.0396, 0.0009, 1.4243), (0.9641, -0.0209, -0.0087)),
            (1.7547, (0.2443, -1.2639, 1.3984), (0.9768, -0.0331, -0.0216)),
            (1.7770, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ),
    },
}
