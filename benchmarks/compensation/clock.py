"""What a step in C costs, on this machine and on a Cortex-M4, and 10^8 of them in a row.

    python -m benchmarks.compensation.clock --out benchmarks/compensation

The inverse of a stage with a lag, sixteen plays, a sensor's curve, four sections of creep and a
mode, at a step of 50 us, along a sine, a triangle and a jumping motion by turns.  clock.csv:

- time: CPU time per step on this machine, C by `cc -O2`, the least of five runs;
- Cortex-M4: instructions per step and the time they take at 168 MHz if each takes one cycle, in
  single precision on a core with its unit (`arm-none-eabi-gcc -O2 -mfloat-abi=hard`), counted by
  QEMU (`-icount`); left out where those are not installed;
- endurance: after 10^8 steps along a motion that repeats every 10^4, the largest difference of the
  drive between its second and its last repeat, and whether the state has moved.
"""

from __future__ import annotations

import argparse
import csv
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import equinox as eqx
import numpy as np

import fracjax as fj
from benchmarks.versions import versions
from fracjax import blocks

STEP, LIMITS, PERIOD = 50e-6, (-20.0, 120.0), 10_000
_MOTION = f"""
static double motion(long n)
{{
    const double t = (double)(n % {PERIOD}) / {PERIOD};
    const long third = n % {PERIOD} * 3 / {PERIOD};
    const double x = 3.0 * t - third;
    if (third == 0) return 3.0 - 2.0 * cos(2.0 * PI * x);
    if (third == 1) return 1.0 + 4.0 * (1.0 - fabs(1.0 - 2.0 * x));
    return x < 0.5 ? 1.0 : 3.0;
}}
"""
_HEAD = (
    '#include "stage.h"\n#include <math.h>\n#include <stdio.h>\n#include <time.h>\n'
    "#define PI 3.14159265358979323846\n"
)
_TIME = (
    _HEAD
    + _MOTION
    + f"""
int main(void)
{{
    static double desired[{PERIOD}];
    double least = 1e9, sum = 0.0;
    REAL u, y;
    stage_state s;
    for (long n = 0; n < {PERIOD}; ++n) desired[n] = motion(n);
    stage_start(&s, 0.0, STAGE_STEP);
    for (int run = 0; run < 5; ++run) {{
        const clock_t began = clock();
        for (long n = 0; n < 1000000; ++n) {{
            stage_step(&s, desired[n % {PERIOD}], &u, &y);
            sum += u;
        }}
        const double seconds = (double)(clock() - began) / CLOCKS_PER_SEC;
        if (seconds < least) least = seconds;
    }}
    printf("%.6g %.3g\\n", least * 1e3, sum);
    return 0;
}}
"""
)
_ENDURE = (
    _HEAD
    + _MOTION
    + f"""
int main(void)
{{
    static double desired[{PERIOD}], second[{PERIOD}];
    double worst = 0.0, u, y;
    stage_state s;
    for (long n = 0; n < {PERIOD}; ++n) desired[n] = motion(n);
    stage_start(&s, 0.0, STAGE_STEP);
    for (long n = 0; n < 100000000; ++n) {{
        const long at = n % {PERIOD};
        stage_step(&s, desired[at], &u, &y);
        if (n >= {PERIOD}L * 2000 && n < {PERIOD}L * 2001) second[at] = u;
        if (n >= 100000000 - {PERIOD} && fabs(u - second[at]) > worst) worst = fabs(u - second[at]);
    }}
    printf("%.6g\\n", worst);
    return 0;
}}
"""
)
_COUNTED = 2000
_BARE = r"""
#include "stage.h"
#define REGISTER(address) (*(volatile unsigned *)(address))
static stage_state s;
static const float motion[] = {
#include "motion.h"
};
extern unsigned top, bss, bss_end;
void reset(void);
__attribute__((section(".vectors"), used)) static void *const vectors[2] = {&top, (void *)reset};
static void semihost(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}
volatile float sink;
int *__errno(void)
{
    static int error;
    return &error;
}
void reset(void)
{
    float u, y;
    char text[12];
    REGISTER(0xE000ED88) |= 0xFu << 20;
    for (unsigned *at = &bss; at < &bss_end; ++at) *at = 0;
    stage_start(&s, 0.0f, STAGE_STEP);
    REGISTER(0xE000E014) = 0xFFFFFF;
    REGISTER(0xE000E018) = 0;
    REGISTER(0xE000E010) = 5;
    const unsigned began = REGISTER(0xE000E018);
    for (unsigned n = 0; n < sizeof motion / sizeof *motion; ++n) {
        stage_step(&s, motion[n], &u, &y);
        sink = u;
    }
    unsigned ticks = (began - REGISTER(0xE000E018)) & 0xFFFFFF;
    text[11] = 0;
    for (int k = 10; k >= 0; --k, ticks /= 10) text[k] = (char)('0' + ticks % 10);
    semihost(4, text);
    semihost(0x18, (void *)0x20026);
    for (;;) {}
}
"""
_SCRIPT = """
SECTIONS {
    . = 0;
    .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) }
    .ARM.exidx : { *(.ARM.exidx*) }
    . = 0x20000000;
    .data : { *(.data*) }
    .bss : { bss = .; *(.bss*) *(COMMON) . = ALIGN(4); bss_end = .; }
    top = 0x20020000;
}
"""
_TICK = 40
"""Instructions per tick of the board's 25 MHz timer, where QEMU counts 1 ns each."""


def stage() -> fj.Model:
    """The model whose cost is asked."""
    radii = 100 * np.geomspace(0.01, 0.45, 16)
    plays = blocks.MinorLoopMemory(np.full(12, 0.003), span=100.0)
    plays = with_radii(plays, np.full(16, 0.0025), radii)
    block = (
        blocks.DriveLag(2e-4)
        >> (blocks.QuasiStaticForce(0.03) + plays)
        >> blocks.SensorNonlinearity(0.02, 0.0, centre=3.0, span=7.0)
        >> blocks.KelvinVoigtCreep(0.01, 0.01)
        >> blocks.Resonance(600.0, 0.03)
    )
    return fj.Model(block, "lag >> 16 plays >> curve >> 4 creep >> mode")


def with_radii(plays: blocks.MinorLoopMemory, weights: np.ndarray, radii: np.ndarray):
    """Plays of other weights and radii."""
    return eqx.tree_at(lambda p: (p.weights.value, p.radii), plays, (weights, radii))


def run(folder: Path, source: str, *flags: str) -> list[float]:
    """What a program prints, compiled with the stage's code."""
    (folder / "main.c").write_text(source)
    command = ["cc", "-std=c99", "-O2", *flags, "main.c", "stage.c", "-o", "main", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run([folder / "main"], capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()]


def cost_of(inverse: fj.StreamingInverse, folder: Path) -> list[dict]:
    rows = []

    def add(what: str, value: float, unit: str) -> None:
        rows.append({"figure": what, "value": f"{value:.3g}", "unit": unit})
        print(rows[-1], flush=True)

    for real in ("double", "float"):
        inverse.write_c(folder, real=real)
        source = _TIME.replace("REAL", real)
        add(f"time per step, {real}", run(folder, source)[0], "ns")
        if real == "float" and shutil.which("arm-none-eabi-gcc"):
            count = instructions(folder)
            add("instructions per step on a Cortex-M4, float", count, "")
            add("time per step at 168 MHz", count / 168, "us")
    inverse.write_c(folder)
    add("largest difference of repeats within 10^8 steps", run(folder, _ENDURE)[0], "V")
    return rows


def instructions(folder: Path) -> float:
    """Instructions per step that QEMU counts on a board with a Cortex-M4."""
    motion = 3 - 2 * np.cos(2 * np.pi * 5 * np.arange(_COUNTED) / _COUNTED)
    (folder / "motion.h").write_text(",\n".join(f"{x:.9f}f" for x in motion))
    (folder / "bare.c").write_text(_BARE)
    (folder / "bare.ld").write_text(_SCRIPT)
    core = ["-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]
    compiler = ["arm-none-eabi-gcc", *core, "-O2", "-std=c99", "-nostartfiles", "-T", "bare.ld"]
    files = ["bare.c", "stage.c", "-lm", "-lc", "-o", "bare.elf"]
    subprocess.run([*compiler, *files], cwd=folder, check=True)
    board = ["qemu-system-arm", "-M", "mps2-an386", "-icount", "shift=0", "-nographic"]
    host = ["-semihosting-config", "enable=on,target=native", "-kernel", "bare.elf"]
    done = subprocess.run(
        [*board, *host], cwd=folder, capture_output=True, text=True, check=True, timeout=120
    )
    return _TICK * int(done.stdout + done.stderr) / _COUNTED


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="The folder of clock.csv.")
    given = parser.parse_args()
    inverse = fj.streaming_inverse(stage(), STEP, (1.0, 100.0), limits=LIMITS)
    with TemporaryDirectory() as scratch:
        rows = cost_of(inverse, Path(scratch))
    with (given.out / "clock.csv").open("w", newline="", encoding="utf-8") as file:
        file.write(versions(("fracjax", "jax", "numpy")))
        writer = csv.DictWriter(file, ("figure", "value", "unit"))
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
