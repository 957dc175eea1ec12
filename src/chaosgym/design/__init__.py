"""What a designer may rely on: from the type of a response to life, reliability and the next change (thesis 5.4, 5.6).

from chaosgym.design import Criteria, assess, improve
assessment = assess(ImpactBeam(), criteria=Criteria(load_rating=500.0, life=500.0))
assessment.verdict, improve(assessment).best
"""

from chaosgym.design.bearing import Criteria, variation_region
from chaosgym.design.improve import improve
from chaosgym.design.methodology import Assessment, assess
from chaosgym.design.trials import Improvement, Trial

__all__ = ["Assessment", "Criteria", "Improvement", "Trial", "assess", "improve", "variation_region"]
