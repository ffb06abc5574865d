"""Simulates examples with rumoca in an interpreter that has it: a line of JSON for each line of JSON that is asked.

Runs as a file, without this project: `python run_rumoca.py FOLDER_OF_LIBRARIES LIMIT`. The timer that bounds the processor
time of an example ends the process, as nothing else stops a run of compiled code.
"""

import json
import signal
import sys
import time

import rumoca  # pyright: ignore[reportMissingImports]


def run(session, asked: dict) -> dict:
    """Processor times and trajectories of an example, or the message of its failure."""
    begin, translate = time.process_time(), 0.0
    try:
        model = session.loads(f"model Asked\n  extends {asked['name']};\nend Asked;\n", model="Asked")
        translate, begin = time.process_time() - begin, time.process_time()
        step = (asked["stop"] - asked["start"]) / (asked["points"] - 1)
        config = rumoca.SimConfig(rtol=asked["tolerance"], atol=asked["tolerance"])
        result = model.simulate((asked["start"], asked["stop"]), dt=step, config=config)
        simulate = time.process_time() - begin
    except rumoca.RumocaError as error:
        return {"error": str(error), "translate": translate or time.process_time() - begin}
    values = {name: list(result[name]) for name in asked["signals"] if name in result}
    return {"translate": translate, "simulate": simulate, "values": {**values, "time": list(result.time)}}


if __name__ == "__main__":
    library, limit = sys.argv[1:]
    libraries = rumoca.Session([library])
    print(json.dumps(rumoca.version()), flush=True)
    for line in sys.stdin:
        signal.setitimer(signal.ITIMER_PROF, float(limit))
        print(json.dumps(run(libraries, json.loads(line))), flush=True)
