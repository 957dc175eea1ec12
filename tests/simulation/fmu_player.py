"""An FMU in this process, by FMPy alone."""

import fmpy
from fmpy.fmi2 import FMU2Slave


class Player:
    """An FMU of FMI 2.0 for co-simulation, initialised at time 0; ``folder`` is where it is unpacked."""

    def __init__(self, path, folder):
        self.about = fmpy.read_model_description(str(path))
        self.variables = {each.name: each for each in self.about.modelVariables}
        self.fmu = FMU2Slave(
            guid=self.about.guid,
            unzipDirectory=str(fmpy.extract(str(path), str(folder))),
            modelIdentifier=self.about.coSimulation.modelIdentifier,
            instanceName="machine",
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.time = 0.0

    def set(self, **values):
        """Set inputs by name."""
        references = [self.variables[name].valueReference for name in values]
        self.fmu.setReal(references, list(values.values()))

    def step(self, size):
        """Move on by a time [s]."""
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def get(self, *names):
        """Values of variables, by their types."""
        readers = {"Real": self.fmu.getReal, "Integer": self.fmu.getInteger}
        about = [self.variables[name] for name in names]
        return [readers[each.type]([each.valueReference])[0] for each in about]
