"""What the scripts that call acados share: its installation, the driver in C, and how they are asked."""

import ctypes
import json
import os
import subprocess
import sys
import warnings

# Read by acados_template when models are compiled; its own default is -O2.
os.environ.setdefault("ACADOS_EXT_FUN_COMPILE_FLAGS", "-O3 -march=native")
HERE, HOME = os.path.dirname(os.path.abspath(__file__)), os.path.abspath(os.environ["ACADOS_SOURCE_DIR"])


def load_driver(folder):
    """The functions of acados_driver.c, compiled for this installation. To be loaded before acados' libraries."""
    library, source = os.path.join(folder, "acados_driver.so"), os.path.join(HERE, "acados_driver.c")
    include = [f"-I{HOME}/include{part}" for part in ("", "/acados", "/blasfeo/include", "/hpipm/include")]
    # A run path of the old kind holds for the libraries of libraries too.
    link = [f"-L{HOME}/lib", f"-Wl,--disable-new-dtags,-rpath,{HOME}/lib", "-lacados", "-lhpipm", "-lblasfeo", "-lm"]
    # A program that runs already may have the old one open.
    fresh = f"{library}.{os.getpid()}"
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", *include, source, "-o", fresh, *link], check=True)
    os.replace(fresh, library)
    return ctypes.CDLL(library, mode=ctypes.RTLD_GLOBAL)


def answer_all(serve):
    """Answers each line of standard input by serve(request, driver, folder); the folder is the argument of the program."""
    # acados prints what it does. Answers have a descriptor of their own.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    warnings.simplefilter("ignore")
    folder = os.path.abspath(sys.argv[1])
    os.makedirs(folder, exist_ok=True)
    os.chdir(folder)
    driver = load_driver(folder)
    for line in sys.stdin:
        try:
            answer = serve(json.loads(line), driver, folder)
        except Exception as error:  # What acados cannot do is left out of the table.
            answer = {"error": (str(error).strip() or repr(error)).splitlines()[-1]}
        print(json.dumps(answer), file=answers, flush=True)
