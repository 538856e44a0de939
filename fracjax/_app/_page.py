"""The page: files and their roles on the left, what came of them on the right."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path
from typing import Any

import panel as pn

from .._io import column_name
from .._models import MODELS
from .._recording import InputError
from .._solve import Progress
from ._job import Job
from ._plots import Plots, brushed_times
from ._texts import command_line, on_the_page, python_code
from ._workspace import LARGEST, ROLES, Workspace

_LIMIT = 600
"""Seconds that a computation may take, unless the page is told otherwise."""
_OF_ROLES = ("time", "input", "output")
_EVERY = 500
"""Milliseconds between two looks at a computation."""
_AUTOMATIC = "by name and unit"
_COLOURS = """
:root { --ink: #1b1f24; --soft: #5b636e; --line: #d9dde2; --paper: #fff; color-scheme: light; }
body { font-family: system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
"""
_TEMPLATE = """
{% block js_resources %}{% endblock %}
{% block contents %}
<style>#starting { padding: 1rem; } #starting:has(~ [data-root-id] > *) { display: none; }</style>
<p id="starting">fracjax is starting.</p>
{{ super() }}
{{ bokeh_js }}
{% endblock %}
"""
"""Panel's page, but for its three megabytes of scripts, which come when something is painted."""
_COPY = "navigator.clipboard.writeText(text.value)"


def page_of(workspace: Workspace) -> Any:
    """A new page for a workspace."""
    pn.extension("filedropper", raw_css=[_COLOURS])
    if pn.state.curdoc is not None:
        # Panel completes a text, which Bokeh's types do not foresee.
        pn.state.curdoc.template = _TEMPLATE  # type: ignore[assignment]
    return _Page(workspace).layout


class _Page:
    """The widgets and what they do; all computing is elsewhere."""

    def __init__(self, workspace: Workspace):
        self.workspace, self.job, self.task = workspace, None, "fit"
        self.plots = Plots()
        self.diagnosis: Any = None
        self._make_inputs()
        self._make_outputs()
        self._list_files()
        pn.state.add_periodic_callback(self._look, period=_EVERY)
        inputs = [
            *("## Files", self.dropper, self.replace, self.roles),
            *("## Columns and units", *self.columns.values(), *self.units.values(), self.rate),
            *("## Model", self.model, self.noise, self.limit),
            *(pn.Row(self.fit, self.diagnose, self.stop), self.stage),
        ]
        outputs = [
            *(self.message, self.sentence, self.facts, self.models, self.plots.pane),
            *(pn.Row(self.loop_step, self.slew, self.in_a_loop), self.promise),
            *(pn.Row(self.leave_out, self.count_all), self.masked),
            pn.FlexBox(self.report, self.next_drive, self.copy_command, self.copy_python),
            *(self.command, self.python),
        ]
        self.layout = pn.FlexBox(
            pn.Column(*inputs, width=330),
            pn.Column(
                *outputs, sizing_mode="stretch_width", min_width=320, styles={"flex": "1 1 30rem"}
            ),
            sizing_mode="stretch_width",
        )
        self._refresh()

    def _make_inputs(self) -> None:
        widgets = pn.widgets
        self.dropper = widgets.FileDropper(
            multiple=True, max_file_size=f"{LARGEST // 1_000_000}MB", chunk_size=5_000_000,
            previews=[], width=310,
        )  # fmt: skip
        self.dropper.param.watch(self._upload, "value")
        self.other: dict[str, bytes] = {}
        self.replace = widgets.Button(visible=False, width=300)
        self.replace.on_click(lambda _: self._keep({**self.other}, replace=True))
        self.roles = pn.Column()
        self.columns = {
            role: widgets.Select(label=f"{label} column", options=[_AUTOMATIC], width=300)
            for role, label in zip(_OF_ROLES, ("time", "drive", "response"), strict=True)
        }
        self.units = {
            f"{role}_unit": widgets.Select(label=f"{label} unit", options=options, width=300)
            for role, label, options in (
                ("time", "time", ["as in the file", "s", "ms", "us"]),
                ("input", "drive", ["as in the file", "V", "mV", "kV", "A", "mA"]),
                ("output", "response", ["as in the file", "um", "nm", "mm", "m", "N", "V"]),
            )
        }
        self.rate = widgets.TextInput(
            label="sampling rate, without a time column", placeholder="200Hz"
        )
        for widget in (*self.columns.values(), *self.units.values(), self.rate):
            widget.param.watch(lambda event: self._choose_reading(), "value")
        self.model = widgets.AutocompleteInput(
            label="model, or a composition such as foh >> creep", options=list(MODELS), value="foh",
            restrict=False, min_characters=0, width=300,
        )  # fmt: skip
        self.noise = widgets.TextInput(label="sensor noise, rms", placeholder="0.07 um")
        self.limit = widgets.IntInput(label="time limit [s]", value=_LIMIT, start=10, end=36_000)
        self.fit = widgets.Button(label="Fit", color="primary")
        self.diagnose = widgets.Button(label="Diagnose", color="primary")
        self.stop = widgets.Button(label="Stop", disabled=True)
        self.fit.on_click(lambda event: self._begin("fit"))
        self.diagnose.on_click(lambda event: self._begin("diagnose"))
        self.stop.on_click(lambda event: self.job and self.job.stop())

    def _make_outputs(self) -> None:
        widgets = pn.widgets
        self.stage, self.message = widgets.StaticText(), pn.pane.Alert("", visible=False)
        self.sentence, self.facts = pn.pane.Markdown(""), pn.pane.Markdown("")
        self.masked = widgets.StaticText()
        self.models = widgets.CheckBoxGroup(label="models", options={})
        self.models.param.watch(lambda event: self._draw(), "value")
        self.leave_out = widgets.Button(label="Leave out what is brushed")
        self.count_all = widgets.Button(label="Count all samples")
        self.leave_out.on_click(lambda event: self._mask(brushed_times(self.plots.samples)))
        self.count_all.on_click(lambda event: self._mask([]))
        self.loop_step = widgets.TextInput(label="step of a loop", value="1 ms", width=150)
        self.slew = widgets.TextInput(label="slew limit", placeholder="50 V/ms", width=150)
        self.in_a_loop = widgets.Button(label="Promise in a loop", disabled=True)
        self.in_a_loop.on_click(lambda event: self._begin("promise"))
        self.promise = pn.pane.HTML("", sizing_mode="stretch_width")
        self.report = widgets.Button(label="Save report", disabled=True)
        self.report.on_click(lambda event: self._save_report())
        self.next_drive = widgets.FileDownload(
            label="Download next drive", filename="next_experiment.csv", callback=self._drive_file,
            disabled=True,
        )  # fmt: skip
        self.command, self.python = (
            widgets.TextAreaInput(label=name, disabled=True, sizing_mode="stretch_width", rows=rows)
            for name, rows in (("Command line", 2), ("Python", 5))
        )
        self.copy_command, self.copy_python = (
            widgets.Button(label=f"Copy {text.label}") for text in (self.command, self.python)
        )
        self.copy_command.js_on_click(args={"text": self.command}, code=_COPY)
        self.copy_python.js_on_click(args={"text": self.python}, code=_COPY)

    # Files -----------------------------------------------------------------------------------

    def _upload(self, event: Any) -> None:
        """Keep uploaded files; whether those replace others of their names is asked."""
        files = {n: c.encode() if isinstance(c, str) else c for n, c in event.new.items()}
        self.other = {n: c for n, c in files.items() if self.workspace.has_other(n, c)}
        self._keep({name: files[name] for name in files if name not in self.other})

    def _keep(self, files: dict[str, bytes], *, replace: bool = False) -> None:
        for name, content in files.items():
            with self._showing_errors():
                self.workspace.add(name, content, replace=replace)
                self.other.pop(name, None)
                self.workspace.roles.setdefault(
                    name, "train" if not self.workspace.with_role("train") else "held out"
                )
        self.replace.label = f"Replace {', '.join(self.other)}, which the folder has already"
        self.replace.visible = bool(self.other)
        self._list_files()
        self._refresh()

    def _list_files(self) -> None:
        """A dropdown of roles for each file."""
        rows = []
        for name in self.workspace.names():
            role = self.workspace.roles.get(name, ROLES[0])
            row = pn.widgets.Select(label=name, options=list(ROLES), value=role, width=300)
            row.param.watch(partial(self._choose_role, name), "value")
            rows.append(row)
        self.roles.objects = rows

    def _choose_role(self, name: str, event: Any) -> None:
        self.workspace.roles[name] = event.new
        self._refresh()

    def _choose_reading(self) -> None:
        options = {role: widget.value for role, widget in self.columns.items()}
        options |= {name: widget.value for name, widget in self.units.items()}
        options["rate"] = self.rate.value or _AUTOMATIC
        unchanged = (_AUTOMATIC, "as in the file")
        chosen = {name: value for name, value in options.items() if value not in unchanged}
        self.workspace.options = chosen  # type: ignore[assignment]
        self._refresh()

    # What is shown ---------------------------------------------------------------------------

    def _refresh(self) -> None:
        """Read the files again: what they hold, their plots, and no results."""
        self.plots.clear()
        self.diagnosis = None
        self.in_a_loop.disabled, self.promise.object = True, ""
        self.sentence.object = self.facts.object = ""
        self.message.visible = False
        self.models.param.update(options={}, value=[])
        train = self.workspace.with_role("train")
        if not train:
            self.facts.object = "Drop a recording, or choose a file to train with."
            return
        with self._showing_errors():
            columns = [_AUTOMATIC, *self.workspace.columns(train[0])]
            for widget in self.columns.values():
                widget.options = columns
            recordings = self.workspace.training()
            self.facts.object = self.plots.show(recordings[0], self.workspace.mask)
        self._write_texts()
        self._draw()

    def _draw(self) -> None:
        self.plots.draw(self.models.value)

    def _write_texts(self) -> None:
        self.workspace.model, self.workspace.noise = self.model.value, self.noise.value
        self.command.value = command_line(self.workspace, self.task)
        self.python.value = python_code(self.workspace, self.task)

    def _mask(self, times: list[tuple[float, float]]) -> None:
        self.workspace.mask = [*self.workspace.mask, *times] if times else []
        spans = ", ".join(f"{start:.4g} to {stop:.4g} s" for start, stop in self.workspace.mask)
        self.masked.value = f"left out: {spans}" if spans else ""
        self._refresh()

    def _showing_errors(self) -> _Shown:
        return _Shown(self.message, self.workspace.folder)

    # Computing -------------------------------------------------------------------------------

    def _begin(self, task: str) -> None:
        if self.job is not None:
            return
        with self._showing_errors():
            self.task = task
            if task != "promise":
                self._write_texts()
            makers = {"fit": self._fitting, "promise": self._promising}
            compute = makers.get(task, self._diagnosing)()
            self.message.visible = False
            self.job = Job(compute, self.limit.value or _LIMIT)
            self.stop.disabled, self.fit.disabled, self.diagnose.disabled = False, True, True

    def _fitting(self) -> Any:
        from .._fit import compare_fits, fit

        recordings, workspace = self.workspace.training(), self.workspace
        model, mask = workspace.model, tuple(workspace.mask)
        held_out = workspace.recordings("held out")

        def compute(progress: Progress) -> object:
            fitted = fit(model, recordings, mask=mask, progress=progress)
            if not held_out:
                return fitted
            return compare_fits([fitted], holdout=held_out, progress=progress)

        return compute

    def _promising(self) -> Any:
        """What the inverse of the last fit, or of what a diagnosis has extended, would leave of
        motions in a loop."""
        from .._recording import parse_quantity
        from .._streaming import streaming_inverse

        fitted = self.plots.latest_fit()
        unit = f"{fitted.preparation.takes[0].recording.drive_unit}/s"
        slew = parse_quantity(self.slew.value, unit, "slew limit") if self.slew.value else None
        step = self.loop_step.value

        def compute(progress: Progress) -> object:
            progress("inverting the model sample by sample")
            inverse = streaming_inverse(fitted, step, slew=slew)
            progress("simulating the promise")
            return inverse.promise()

        return compute

    def _diagnosing(self) -> Any:
        from .._diagnose import diagnose

        workspace = self.workspace
        recordings, held_out = workspace.training(), workspace.recordings("held out")
        options = {
            "holdout": held_out[0] if held_out else None,
            "repeat": workspace.recordings("repeat") or None,
            "noise": workspace.noise or None,
            "mask": tuple(workspace.mask),
            "max_time": self.limit.value or _LIMIT,
        }
        model = workspace.model

        def compute(progress: Progress) -> object:
            return diagnose(model, recordings, progress=progress, **options)

        return compute

    def _look(self) -> None:
        """Show how far the computation is, and its result at its end."""
        job = self.job
        if job is None:
            return
        if job.running:
            limit = f"{job.elapsed:.0f} s so far, at most {job.remaining:.0f} s remain"
            self.stage.value = "; ".join(filter(None, (job.stage, job.forecast, limit)))
            return
        self.job = None
        self.stop.disabled, self.fit.disabled, self.diagnose.disabled = True, False, False
        done = "done" if getattr(job.result, "complete", True) else "ended with the verdict so far"
        self.stage.value = job.message or f"{done} in {job.elapsed:.0f} s"
        if job.result is not None:
            self._take(job.result)

    def _take(self, result: Any) -> None:
        """Show a fit, a diagnosis or a promise beside what there is."""
        if self.task == "promise":
            self.promise.object = result._repr_html_()
            return
        if self.task == "diagnose":
            self.diagnosis = result
        self.sentence.object = self.plots.take(result)
        self.models.param.update(options=self.plots.choices(), value=self.plots.latest())
        self.report.disabled = self.in_a_loop.disabled = False
        self.promise.object = ""
        self.next_drive.disabled = self.diagnosis is None or not self.diagnosis.next_experiment
        self._draw()

    def _save_report(self) -> None:
        from .._report import write_report

        folder = self.workspace.folder
        taken = {path.name for path in folder.glob("report*.html")}
        names = ("report.html", *(f"report-{k}.html" for k in range(2, len(taken) + 3)))
        path = folder / next(name for name in names if name not in taken)
        write_report(self.plots.result, path, command=self.command.value, seed=0)
        self.stage.value = f"written: {path}"

    def _drive_file(self) -> io.BytesIO:
        drive = self.diagnosis.next_experiment.drive
        unit = self.diagnosis.base.preparation.takes[0].recording.drive_unit
        lines = [f"time_s,{column_name('drive', unit)}"]
        lines += [f"{t:.9g},{u:.9g}" for t, u in zip(drive.times, drive.values, strict=True)]
        return io.BytesIO("\n".join(lines).encode() + b"\n")


class _Shown:
    """Within this, an InputError is shown on the page."""

    def __init__(self, pane: Any, folder: Path):
        self._pane, self._folder = pane, folder

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: Any, trace: Any) -> bool:
        if not isinstance(error, InputError):
            return False
        text = on_the_page(f"{error}", self._folder)
        self._pane.param.update(object=text, alert_type="danger", visible=True)
        return True
