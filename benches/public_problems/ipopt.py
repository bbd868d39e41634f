"""IPOPT through CasADi on the problem that CASADOS_PROBLEM names, of the library that is the first
argument, with a limit of CPU time in seconds. For each line of standard input it solves the problem
once, by default options, and writes a JSON object:

    {"status": "Solve_Succeeded", "iterations": 15, "objective": 8.04, "time": 0.012}

where the time is that of the CPU. Functions and derivatives are computed in the library."""

import json
import sys
import time

import casadi


def main():
    library, limit = sys.argv[1], float(sys.argv[2])
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0, "ipopt.max_cpu_time": limit}
    try:
        bounds = casadi.external("nlp_bounds", library)()
        solver = casadi.nlpsol("solver", "ipopt", library, options)
    except Exception as error:  # noqa: BLE001: whatever it is, the other side is to know
        bounds, solver, failure = None, None, str(error)
    for _ in sys.stdin:
        if solver is None:
            print(json.dumps({"error": failure}), flush=True)
            continue
        begin = time.process_time()
        try:
            solution = solver(**bounds)
            stats = solver.stats()
            answer = {
                "status": stats["return_status"],
                "iterations": stats["iter_count"],
                "objective": float(solution["f"]),
                "time": time.process_time() - begin,
            }
        except Exception as error:  # noqa: BLE001
            answer = {"error": str(error)}
        print(json.dumps(answer), flush=True)


main()
