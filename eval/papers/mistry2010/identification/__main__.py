"""Run the identification experiment alone."""

from eval.papers.experiment import main
from eval.papers.mistry2010.identification import EXPERIMENT

if __name__ == "__main__":
    main(EXPERIMENT)
