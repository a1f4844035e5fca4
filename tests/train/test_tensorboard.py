import time

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from train.tensorboard import TensorBoardLog


def test_tensorboard_hides_what_is_taken_again(tmp_path):
    log = TensorBoardLog(tmp_path, 0)
    for steps in (1, 2, 3, 4):
        log.append("train", {"steps": steps, "value": float(steps)})
    log.close()
    # Event files are read by the second in which they begin, then by "9" after "10".
    time.sleep(1.0)
    log = TensorBoardLog(tmp_path, 2)
    for steps in (3, 4, 5):
        log.append("train", {"steps": steps, "value": 10.0 * steps})
    log.close()
    events = EventAccumulator(str(tmp_path))
    events.Reload()
    found = [(e.step, e.value) for e in events.Scalars("train/value")]
    assert found == [(1, 1.0), (2, 2.0), (3, 30.0), (4, 40.0), (5, 50.0)]
