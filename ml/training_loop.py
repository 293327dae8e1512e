"""The training loop of all tasks: AdamW, warm-up and cosine, clipping, averaging, exact resuming, several processes."""

import math
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.machine import available_cores
from synthroads_addon.base.progress import Progress, Stage, silent

from .configuration import Configuration, Schedule
from .processes import average, process_count, process_number
from .runs import Run, load_state, stream_seed
from .weight_averaging import RunningMean, renew_statistics

M = TypeVar("M", bound=nn.Module)
Figures = dict[str, float]
Batches = Callable[[int, slice], Iterable[Any]]
"""Function that returns the batches of an epoch whose numbers a slice selects; equal calls give equal batches."""
Loss = Callable[[M, Any], tuple[Tensor, Figures]]
"""Function that returns a batch's loss, which is minimised, and further figures, which are averaged over the epoch."""
MEAN = "mean"
"""Key of the running mean of the weights in the checkpoints of a training that averages, all but the last one."""


def chosen_device(configuration: Configuration) -> torch.device:
    """Return the device that a configuration asks for; also sets PyTorch's number of threads.

    Raises:
        InputError: there is no such device.
    """
    if configuration.threads:
        torch.set_num_threads(configuration.threads)
    elif configuration.processes > 1:
        torch.set_num_threads(max(1, available_cores() // configuration.processes))
    if configuration.device == "auto" and not torch.cuda.is_available():
        return torch.device("cpu")
    if configuration.device in ("auto", "cuda") and torch.cuda.is_available():
        return torch.device("cuda", process_number())
    if configuration.device.startswith("cuda") and not torch.cuda.is_available():
        raise InputError("device", configuration.device, "PyTorch finds no CUDA device; choose cpu or auto")
    return torch.device(configuration.device)


def fit(
    model: M,
    run: Run[Any],
    batches: Batches,
    batches_per_epoch: int,
    loss: Loss[M],
    *,
    validate: Callable[[M, int], Figures] | None = None,
    progress: Progress = silent,
) -> None:
    """Train a model in place, beginning after the run's last checkpoint.

    The result depends on the configuration alone: epoch ``e`` draws its batches from ``batches(e, ...)`` and its
    dropout from a stream keyed by seed and epoch, so that an interrupted training ends with the same weights.

    Of N processes each takes every N-th batch, and of these as many as are accumulated make a step; gradients are
    averaged, as if a step's batches were one. Batches that don't make up a whole step are left out, but for the
    accumulation of one process, whose last step may have fewer. The first process alone validates and saves.

    With ``schedule.averaging`` the model ends with the running mean of its weights, and its batch norms with the
    statistics of this mean over the batches of the last epoch; epochs are validated with their last weights.

    Args:
        model: model, on the device it is trained on.
        run: run that keeps checkpoint and history.
        batches: function that returns the batches of one epoch.
        batches_per_epoch: number of an epoch's batches.
        loss: loss of one batch; NaN or infinity ends the training.
        validate: function that computes further figures after an epoch.
        progress: called with the share of all steps that is done.

    Raises:
        InputError: the loss is no longer finite, or an epoch has fewer batches than there are processes.
    """
    configuration, schedule, number = run.configuration, run.configuration.schedule, process_number()
    share, steps_per_epoch = _own_batches(configuration, batches_per_epoch)
    optimizer = optimizer_of(model, schedule)
    run.begin()
    first_epoch, mean = _resume(model, optimizer, run)
    for epoch in range(first_epoch, schedule.epochs):
        start_time = time.perf_counter()
        torch.manual_seed(stream_seed(configuration.seed, "epoch", epoch, *([number] if number else [])))
        model.train()
        figures: list[Figures] = []
        loss_sum = 0.0
        for step, step_batches in enumerate(
            _groups(batches(epoch, share), configuration.accumulation), start=epoch * steps_per_epoch
        ):
            rate = learning_rate(schedule, step, schedule.epochs * steps_per_epoch)
            figures.append(train_step(model, optimizer, rate, configuration, loss, *step_batches))
            if mean is not None:
                mean.add(model, step)
            loss_sum += figures[-1]["loss"]
            detail = f"epoch {epoch + 1} of {schedule.epochs}, loss {loss_sum / len(figures):.3g}"
            progress(Stage("training", detail), (step + 1) / (schedule.epochs * steps_per_epoch))
        summary = {"epoch": epoch + 1, **_means(figures), "learning_rate": optimizer.param_groups[0]["lr"]}
        average([buffer for buffer in model.buffers() if buffer.is_floating_point()])  # statistics of norms
        # Helper processes neither validate nor save.
        if number:
            continue
        if validate is not None:
            model.eval()
            summary |= validate(model, epoch + 1)
        run.record({**summary, "seconds": round(time.perf_counter() - start_time, 3)})
        run.save(_checkpoint(model, optimizer, epoch + 1, mean))
    if mean is not None:
        _end_with_mean(model, mean, batches(schedule.epochs - 1, share), configuration, loss)
        if not number:
            run.save(_checkpoint(model, optimizer, schedule.epochs))


def _own_batches(configuration: Configuration, batches_per_epoch: int) -> tuple[slice, int]:
    """Return the numbers of this process's batches of an epoch, and the number of its steps.

    Raises:
        InputError: an epoch has fewer batches than there are processes.
    """
    count, batches_per_step = process_count(), configuration.accumulation
    steps = batches_per_epoch // (count * batches_per_step) if count > 1 else -(-batches_per_epoch // batches_per_step)
    if steps == 0 and count > 1:
        raise InputError("processes", count, f"must not exceed the batches of an epoch, {batches_per_epoch}")
    return slice(process_number(), min(steps * count * batches_per_step, batches_per_epoch), count), steps


def _resume(model: nn.Module, optimizer: torch.optim.Optimizer, run: Run[Any]) -> tuple[int, RunningMean | None]:
    """Load a run's last checkpoint, if there is one, into a model and its optimiser, in place.

    Returns:
        The number of finished epochs, and the running mean of the weights; None where none is kept, or the model has
        become it already.
    """
    schedule: Schedule = run.configuration.schedule
    state = run.last_checkpoint(next(model.parameters()).device)
    mean = RunningMean(model, schedule.averaging) if schedule.averaging else None
    if state is None:
        return 0, mean
    load_state(model, state["model"], str(run.folder))
    load_state(optimizer, state.get("optimizer"), str(run.folder))
    if mean is None or (state["epoch"] == schedule.epochs and MEAN not in state):
        return state["epoch"], None
    load_state(mean.network, state.get(MEAN, {}), str(run.folder))
    return state["epoch"], mean


def _checkpoint(
    model: nn.Module, optimizer: torch.optim.Optimizer, epoch: int, mean: RunningMean | None = None
) -> dict[str, Any]:
    """Return the state that a training goes on from after some epochs."""
    state = {"model": model.state_dict(), "optimizer": optimizer.state_dict(), "epoch": epoch}
    return state if mean is None else {**state, MEAN: mean.network.state_dict()}


def _end_with_mean(
    model: M, mean: RunningMean, batches: Iterable[Any], configuration: Configuration, loss: Loss[M]
) -> None:
    """Set a model to the running mean of its weights with the statistics of norms that belong to it, in place."""
    uses_bfloat16, number = configuration.precision == "bfloat16", process_number()

    def forward(model: M, batch: Any) -> None:
        """Send a batch through the model as a step of the training does."""
        with torch.autocast(next(model.parameters()).device.type, torch.bfloat16, enabled=uses_bfloat16):
            loss(model, move_to_device(model, batch))

    torch.manual_seed(stream_seed(configuration.seed, "mean", *([number] if number else [])))
    mean.copy_to(model)
    renew_statistics(model, batches, forward)
    average([buffer for buffer in model.buffers() if buffer.is_floating_point()])


def move_to_device(model: nn.Module, batch: Any) -> Any:
    """Return a tensor, or a dictionary of tensors, moved to the model's device."""
    device = next(model.parameters()).device
    if isinstance(batch, Tensor):
        return batch.to(device)
    return {name: value.to(device, non_blocking=True) for name, value in batch.items()}


def learning_rate(schedule: Schedule, step: int, steps: int) -> float:
    """Return the learning rate of a step from 0: linear warm-up to the largest, then a cosine to the final one."""
    warmup_steps = schedule.warmup * steps
    if step < warmup_steps:
        return schedule.learning_rate * (step + 1) / (warmup_steps + 1)
    share = (step - warmup_steps) / max(steps - 1 - warmup_steps, 1)
    span = schedule.learning_rate - schedule.final_learning_rate
    return schedule.final_learning_rate + 0.5 * span * (1 + math.cos(math.pi * min(share, 1.0)))


def optimizer_of(model: nn.Module, schedule: Schedule) -> torch.optim.AdamW:
    """Return an AdamW optimiser of all weights; biases and norms' scales have no weight decay."""
    matrices = [weight for weight in model.parameters() if weight.ndim > 1]
    vectors = [weight for weight in model.parameters() if weight.ndim <= 1]
    groups = [{"params": matrices, "weight_decay": schedule.weight_decay}, {"params": vectors, "weight_decay": 0.0}]
    return torch.optim.AdamW(groups, lr=schedule.learning_rate)


def train_step(
    model: M, optimizer: torch.optim.Optimizer, rate: float, configuration: Configuration, loss: Loss[M], *batches: Any
) -> Figures:
    """Do one optimiser step with gradients averaged over batches and processes; return mean loss and other figures.

    The loss is the mean over all processes, the other figures are this process's.

    Raises:
        InputError: the loss is no longer finite.
    """
    for group in optimizer.param_groups:
        group["lr"] = rate
    optimizer.zero_grad(set_to_none=True)
    uses_bfloat16 = configuration.precision == "bfloat16"
    values: list[Tensor] = []
    parts: list[Figures] = []
    for batch in batches:
        with torch.autocast(next(model.parameters()).device.type, torch.bfloat16, enabled=uses_bfloat16):
            value, figures = loss(model, move_to_device(model, batch))
        (value / len(batches)).backward()
        values.append(value.detach())
        parts.append(figures)
    mean = torch.stack(values).mean()
    average([mean])  # not finite in one process, it is in none: all end
    if not torch.isfinite(mean):
        raise InputError("schedule.learning_rate", rate, f"the loss became {mean.item()}; a smaller rate may help")
    if process_count() > 1:
        for weight in model.parameters():
            weight.grad = torch.zeros_like(weight) if weight.grad is None else weight.grad
        average([weight.grad for weight in model.parameters() if weight.grad is not None])
    nn.utils.clip_grad_norm_(model.parameters(), configuration.schedule.clip)
    optimizer.step()
    return {"loss": mean.item(), **_means(parts)}


def _groups(batches: Iterable[Any], size: int) -> Iterator[list[Any]]:
    """Yield batches in lists of a size; the last one may be shorter."""
    group: list[Any] = []
    for batch in batches:
        group.append(batch)
        if len(group) == size:
            yield group
            group = []
    if group:
        yield group


def _means(figures: list[Figures]) -> Figures:
    """Return the mean of each figure over steps; InputError without any."""
    if not figures:
        raise InputError("training data", 0, "an epoch must have at least one batch: use more data or a smaller batch")
    return {name: math.fsum(step[name] for step in figures) / len(figures) for name in figures[0]}
