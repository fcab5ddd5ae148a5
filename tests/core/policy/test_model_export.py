"""Every model as an ONNX file answers as it does in torch, for any number of agents."""

from __future__ import annotations

import io

import onnxruntime
import pytest
import torch
from torch import nn

from cfnav_core.models.base import ModelInput, ObservationSpec
from cfnav_core.models.table import MODELS
from tests.core.model_samples import BUILT_IN, SIGHTED, SMALL, knowledge, views

FIELDS = tuple(ModelInput.__dataclass_fields__)


class Flat(nn.Module):
    """A model with plain tensors in and out."""

    def __init__(self, model):
        super().__init__()
        self.model, self.names = model, tuple(model.state_shapes)

    def forward(self, *tensors):
        seen, state = tensors[: len(FIELDS)], tensors[len(FIELDS) :]
        logits, value, state = self.model(
            ModelInput(*seen), dict(zip(self.names, state, strict=True))
        )
        return logits, value, *(state[name] for name in self.names)


def export(model, inputs: ObservationSpec) -> onnxruntime.InferenceSession:
    flat, file = Flat(model).eval(), io.BytesIO()
    example = (*vars(views(inputs, 2)).values(), *model.zero_state(2).values())
    outputs = ["logits", "value", *(f"next_{name}" for name in flat.names)]
    names = [*FIELDS, *flat.names]
    torch.onnx.export(
        flat, example, file, dynamo=False, opset_version=17, input_names=names,
        output_names=outputs, dynamic_axes={k: {0: "n"} for k in (*names, *outputs)},
    )  # fmt: skip
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(file.getvalue(), options)


READ = [(name, BUILT_IN) for name in sorted(MODELS)] + [("tdanet", SIGHTED)]


@pytest.mark.parametrize(("name", "inputs"), READ, ids=[f"{n}-{i.detections}" for n, i in READ])
@pytest.mark.filterwarnings("error", "ignore::DeprecationWarning")
def test_onnx_equals_torch(name, inputs):
    torch.manual_seed(0)
    model = MODELS[name](inputs, SMALL, knowledge(38)).eval()
    session = export(model, inputs)
    taken = {i.name for i in session.get_inputs()}
    for batch in (1, 5):
        state, given = model.zero_state(batch), {}
        for t in range(4):
            # the last view repeats the one before, so that the layout gap fades
            seen = views(inputs, batch, seed=min(t, 2))
            with torch.no_grad():
                logits, value, state = model(seen, state)
            feeds = {k: v.numpy() for k, v in vars(seen).items()}
            feeds |= given or {k: v.numpy() for k, v in model.zero_state(batch).items()}
            found = session.run(None, {k: v for k, v in feeds.items() if k in taken})
            given = dict(zip(state, found[2:], strict=True))
            expected = [logits, value, *state.values()]
            for a, b in zip(found, expected, strict=True):
                torch.testing.assert_close(torch.from_numpy(a), b, rtol=1e-4, atol=1e-5)
