"""What is wrong with problems, systems and their functions, and what is said about it."""

import pytest

from .fault import Fault, is_met
from .typed import faults

BY_NAME = r"""
load('sitnikof')                                             | unknown problem 'sitnikof'; did you mean
load(3)                                                      | unknown problem 3; known: charged_particle,
load(None)                                                   | unknown problem None; known:
load(['kepler'])                                             | unknown problem ['kepler']; did you mean
load('kepler', ee=.6)                                        | unknown argument of kepler 'ee'; did you mean
load('kepler', e='0.6')                                      | e='0.6' of kepler must be an eccentricity, 0
load('kepler', e=None)                                       | e=None of kepler must be an eccentricity, 0
load('kepler', e=nan)                                        | e=nan of kepler must be an eccentricity, 0
load('kepler', e=1.0)                                        | e=1.0 of kepler must be an eccentricity, 0 <=
load('kepler', e=-.1)                                        | e=-0.1 of kepler must be an eccentricity, 0
load('kepler', e=huge)                                       | e=about 1e400 of kepler must be an
load('kepler', e=True)                                       | e=True of kepler must be an eccentricity, 0
load('kepler', e=[.6])                                       | e=[0.6] of kepler must be an eccentricity, 0
load('kepler', e=np.array([.6, .7]))                         | e=[0.6, 0.7] of kepler must be an
load('kepler', e=1j)                                         | e=1j of kepler is complex, and must be real; a
load('kepler', t_end='100')                                  | t_end='100' of kepler must be a finite number
load('kepler', t_end=nan)                                    | t_end=nan of kepler must be a finite number
load('kepler', t_end=inf)                                    | t_end=inf of kepler must be a finite number
load('kepler', t_end=huge)                                   | t_end=about 1e400 of kepler must be a finite
load('kepler', t_end=-huge)                                  | t_end=-about 1e400 of kepler must be a finite
load('kepler', t_end=None)                                   | t_end=None of kepler must be a finite number
load('kepler', t_end=[1])                                    | t_end=[1] of kepler must be a finite number
load('fput', n=1e8)                                          | n=100000000.0 of fput must be a whole number
load('fput', n=10**8)                                        | HBVM_BENCH_MAX_COMPONENTS
load('fput', n=huge)                                         | HBVM_BENCH_MAX_COMPONENTS
load('fput', n=1)                                            | n=1 of fput must be a whole number of at
load('fput', n=-3)                                           | n=-3 of fput must be a whole number of at
load('fput', n='32')                                         | n='32' of fput must be a whole number of at
load('fput', n=None)                                         | n=None of fput must be a whole number of at
load('fput', n=True)                                         | n=True of fput must be a whole number of at
load('fput', n=2.5)                                          | n=2.5 of fput must be a whole number of at
load('fput', n=[8])                                          | n=[8] of fput must be a whole number of at
load('fput', start='modes')                                  | unknown start of fput 'modes'; did you mean
load('fput', start=3)                                        | unknown start of fput 3; known: mode, thermal
load('fput', start=None)                                     | unknown start of fput None; known: mode,
load('fput', start=['mode'])                                 | unknown start of fput ['mode']; did you mean
load('fput', temperature=0)                                  | temperature=0 of fput must be a positive
load('fput', temperature=-1)                                 | temperature=-1 of fput must be a positive
load('fput', temperature=nan, start='thermal')               | temperature=nan of fput must be a positive
load('fput', temperature=1e308, start='thermal')             | p0 must be finite, not [-inf, -inf, -inf,
load('fput', amplitude=inf)                                  | amplitude=inf of fput must be a finite number
load('fput', seed=-1)                                        | seed=-1 of fput must be a whole number of at
load('fput', seed=1.5)                                       | seed=1.5 of fput must be a whole number of at
load('fput', seed='a')                                       | seed='a' of fput must be a whole number of at
load('fput', alpha='a')                                      | alpha='a' of fput must be a finite number
load('fput', alpha=huge)                                     | alpha=about 1e400 of fput must be a finite
load('cluster', n=10**7)                                     | HBVM_BENCH_MAX_COMPONENTS
load('cluster', n=10**4)                                     | HBVM_BENCH_MAX_TERMS
load('cluster', n=1)                                         | n=1 of cluster must be a whole number of at
load('cluster', n=2.0)                                       | n=2.0 of cluster must be a whole number of at
load('cluster', softening=0)                                 | softening=0 of cluster must be a positive
load('cluster', softening=-1)                                | softening=-1 of cluster must be a positive
load('cluster', seed=None)                                   | seed=None of cluster must be a whole number
load('lennard_jones', rings=1000)                            | HBVM_BENCH_MAX_COMPONENTS
load('lennard_jones', rings=0)                               | rings=0 of lennard_jones must be a whole
load('lennard_jones', rings=2.5)                             | rings=2.5 of lennard_jones must be a whole
load('lennard_jones', temperature=0)                         | temperature=0 of lennard_jones must be
load('lennard_jones', temperature='x')                       | temperature='x' of lennard_jones must be a
load('toda', n=10**9)                                        | HBVM_BENCH_MAX_COMPONENTS
load('toda', n=2)                                            | n=2 of toda must be a whole number of at
load('toda', spread=0)                                       | spread=0 of toda must be a positive number.
load('toda', spread=1e308)                                   | p0 must be finite, not
load('sine_gordon', n=10**9)                                 | HBVM_BENCH_MAX_COMPONENTS
load('sine_gordon', n=2)                                     | n=2 of sine_gordon must be a whole number of
load('sine_gordon', gamma=0)                                 | gamma=0 of sine_gordon must be a positive
load('sine_gordon', gamma=1e-320)                            | p0 must be finite, not [0.0, 0.0, 0.0, 0.0,
load('sine_gordon', length=-1)                               | length=-1 of sine_gordon must be a positive
load('sine_gordon', length=1e-320)                           | parameter 'stiffness' is inf; give one finite
load('nonlinear_wave', n=10**9)                              | HBVM_BENCH_MAX_COMPONENTS
load('nonlinear_wave', n=2)                                  | n=2 of nonlinear_wave
load('nonlinear_wave', mass='a')                             | mass='a' of nonlinear_wave must be a finite
load('nonlinear_wave', kappa=nan)                            | kappa=nan of nonlinear_wave must be a finite
load('nonlinear_wave', amplitude=huge)                       | amplitude=about 1e400 of nonlinear_wave must
load('stiff_chain', springs=10**9)                           | HBVM_BENCH_MAX_COMPONENTS
load('stiff_chain', springs=1)                               | springs=1 of stiff_chain must be a whole
load('stiff_chain', omega=0)                                 | omega=0 of stiff_chain must be a positive
load('stiff_chain', omega=1e-320)                            | q0 must be finite, not [1.0, 0.0, 0.0, inf,
load('cr3bp', loops=5)                                       | loops=5 of cr3bp must be one of 4, 3, 2
load('cr3bp', loops='4')                                     | loops='4' of cr3bp must be one of 4, 3, 2
load('cr3bp', loops=4.0)                                     | loops=4.0 of cr3bp must be one of 4, 3, 2
load('cr3bp', loops=True)                                    | loops=True of cr3bp must be one of 4, 3, 2
load('cr3bp', mu=2)                                          | mu=2 of cr3bp must be a number between 0 and
load('cr3bp', mu=0)                                          | mu=0 of cr3bp must be a number between 0 and
load('cr3bp', mu='a')                                        | mu='a' of cr3bp must be a number between 0
load('cr3bp', mu=nan)                                        | mu=nan of cr3bp must be a number between 0
load('sitnikov', e=1.5)                                      | e=1.5 of sitnikov must be an eccentricity, 0
load('sitnikov', e=1)                                        | e=1 of sitnikov must be an eccentricity, 0 <=
load('sitnikov', d=0)                                        | d=0 of sitnikov must be a positive number.
load('sitnikov', d=-5)                                       | d=-5 of sitnikov must be a positive number.
load('sitnikov', d='a')                                      | d='a' of sitnikov must be a positive number.
load('sitnikov', d=nan)                                      | d=nan of sitnikov must be a positive number.
load('sitnikov', m3=-1)                                      | m3=-1 of sitnikov must be a positive number.
load('sitnikov', m3=0)                                       | m3=0 of sitnikov must be a positive number.
load('sitnikov', v3='fast')                                  | v3='fast' of sitnikov must be a finite number
load('sitnikov', v3=huge)                                    | v3=about 1e400 of sitnikov must be a finite
load('sitnikov', z3=None)                                    | z3=None of sitnikov must be a finite number
load('henon_heiles', energy=-1)                              | energy=-1 of henon_heiles is less than the
load('henon_heiles', energy=0)                               | energy=0 of henon_heiles is less than the
load('henon_heiles', energy='a')                             | energy='a' of henon_heiles must be a finite
load('henon_heiles', q1=10)                                  | energy=0.16566666666666666 of henon_heiles is
load('henon_heiles', q2=nan)                                 | q2=nan of henon_heiles must be a finite
load('henon_heiles', q1=1e308)                               | energy=0.16566666666666666 of henon_heiles is
load('henon_heiles', direction='up')                         | direction='up' of henon_heiles must be a
load('henon_heiles', direction=nan)                          | direction=nan of henon_heiles must be a
load('pendulum', q='a')                                      | q='a' of pendulum must be a finite number
load('pendulum', p=inf)                                      | p=inf of pendulum must be a finite number
load('double_pendulum', m1=0)                                | m1=0 of double_pendulum must be a positive
load('double_pendulum', l1=-1)                               | l1=-1 of double_pendulum must be a positive
load('double_pendulum', g='a')                               | g='a' of double_pendulum must be a finite
load('double_pendulum', q1=nan)                              | q1=nan of double_pendulum must be a finite
load('spring_pendulum', k=0)                                 | k=0 of spring_pendulum must be a positive
load('spring_pendulum', m=-1)                                | m=-1 of spring_pendulum must be a positive
load('spring_pendulum', l0=0)                                | l0=0 of spring_pendulum must be a positive
load('spring_pendulum', x='a')                               | x='a' of spring_pendulum must be a finite
load('spring_pendulum', g=nan)                               | g=nan of spring_pendulum must be a finite
load('morse', D=0)                                           | D=0 of morse must be a positive number.
load('morse', a=-1)                                          | a=-1 of morse must be a positive number.
load('morse', m='a')                                         | m='a' of morse must be a positive number.
load('morse', q=nan)                                         | q=nan of morse must be a finite number
load('diatomic', r=0)                                        | r=0 of diatomic must be a positive number.
load('diatomic', r='a')                                      | r='a' of diatomic must be a positive number.
load('diatomic', vr=nan)                                     | vr=nan of diatomic must be a finite number
load('charged_particle', charge='a')                         | charge='a' of charged_particle must be a
load('charged_particle', x=nan)                              | x=nan of charged_particle must be a finite
load('charged_particle', x=0, y=0)                           | x=0 and y=0 of charged_particle are the
load('penning_trap', omega_c=0)                              | omega_c=0 of penning_trap must be a positive
load('penning_trap', omega_z=10)                             | omega_c=5.0 of penning_trap does not hold the
load('penning_trap', c4='a')                                 | c4='a' of penning_trap must be a finite
load('rigid_body', quartic='a')                              | quartic='a' of rigid_body must be a finite
load('rigid_body', quartic=inf)                              | quartic=inf of rigid_body must be a finite
load('lotka_volterra', t_end='a')                            | t_end='a' of lotka_volterra must be a finite
load('figure_eight', t_end='a')                              | t_end='a' of figure_eight must be a finite
load('pythagorean', t_end=nan)                               | t_end=nan of pythagorean must be a finite
load('outer_solar_system', unit='month')                     | unknown unit of outer_solar_system 'month';
load('outer_solar_system', unit='days')                      | did you mean 'day'
load('outer_solar_system', unit=3)                           | unknown unit of outer_solar_system 3; known:
load('outer_solar_system', frame='sun')                      | unknown frame of outer_solar_system 'sun';
load('outer_solar_system', frame=None)                       | unknown frame of outer_solar_system None;
load('outer_solar_system', t_end='a')                        | t_end='a' of outer_solar_system must be a
load('solar_system', unit=['year'])                          | unknown unit of solar_system ['year']; did
load('solar_system', t_end=inf)                              | t_end=inf of solar_system must be a finite
load('period_annulus', start='a')                            | start='a' of period_annulus must be a finite
load('period_annulus', start=nan)                            | start=nan of period_annulus must be a finite
load('period_annulus', a=3)                                  | a=3 of period_annulus must be a list of 4
load('period_annulus', a=[1])                                | a=[1] of period_annulus must be a list of 4
load('period_annulus', a=['a', 0, 0, 0])                     | a=['a', 0, 0, 0] of period_annulus must be a
load('period_annulus', a=None)                               | a=None of period_annulus must be a list of 4
load('period_annulus', b=[nan, 0, 0, 0])                     | b=[nan, 0, 0, 0] of period_annulus must be a
load('period_annulus', c='abcd')                             | c='abcd' of period_annulus must be a list of
load('expression', H=3)                                      | H=3 of expression must be text, such as
load('expression', H='')                                     | an empty formula; write one such as "p^2/2 -
load('expression', H='p^2/2 +')                              | cannot read the formula 'p^2/2 +': it is
load('expression', H='p^2/2 - cos(q')                        | cannot read the formula 'p^2/2 - cos(q': it
load('expression', H='p^2/2 - cosine(q)')                    | cannot read the formula 'p^2/2 - cosine(q)':
load('expression', H='p^2/2 + z')                            | the formula 'p^2/2 + z' contains 'z', which
load('expression', H='import os')                            | cannot read the formula 'import os': it is
load('expression', H='p^2/2 + 1/0')                          | cannot read the formula 'p^2/2 + 1/0': `1 / 0`
load('expression', H='1')                                    | the formula '1' contains no coordinate; use q
load('expression', H=None)                                   | H=None of expression must be text, such as
load('expression', H='(' * 3000)                             | cannot read the formula
load('expression', H='('*300 + 'q' + ')'*300)                | cannot read the formula
load('expression', H='q' + '+q'*50000)                       | a formula of 100001 characters is too long;
load('expression', H='p9999999^2/2 + q9999999')              | the formula 'p9999999^2/2 + q9999999' has
load('expression', H='p2^2/2 + q2', q0=[1], p0=[2])          | q0=[1.0] of expression must be a list of 2
load('expression', q0='a')                                   | q0='a' of expression must be a list of
load('expression', q0=[nan])                                 | q0=[nan] of expression must be a list of
load('expression', q0=3)                                     | q0=3 of expression must be a list of finite
load('expression', q0=None)                                  | q0=None of expression must be a list of
load('expression', q0=[1, 2])                                | q0=[1.0, 2.0] of expression must be a list
load('expression', p0=[])                                    | p0=[] of expression must be a list of 1
load('expression', parameters='k')                           | cannot read 'k'; write parameters as "k=2,
load('expression', parameters='k=a')                         | cannot read 'k=a'; write parameters as "k=2,
load('expression', parameters='k=1, k=2')                    | the parameter 'k' is given twice
load('expression', parameters=3)                             | parameters=3 of expression must be text,
load('expression', parameters='k=1e999')                     | cannot read 'k=1e999'; write parameters as
load('expression', parameters='k=2')                         | unknown parameter, not in the formula, 'k';
load('expression', parameters='import=2')                    | unknown parameter, not in the formula,
load('expression', t_end='a')                                | t_end='a' of expression must be a finite
"""

SYSTEMS = r"""
Hamiltonian()                                                | Hamiltonian needs H, dof; give a value as in
Hamiltonian(osc)                                             | Hamiltonian needs dof; give a value as in
Hamiltonian(osc, 1)                                          | Hamiltonian takes only H by place and the
Hamiltonian(osc, dog=1)                                      | unknown argument of Hamiltonian 'dog'; did
Hamiltonian(osc, dof=0)                                      | dof=0 of Hamiltonian must be a whole number
Hamiltonian(osc, dof=-1)                                     | dof=-1 of Hamiltonian must be a whole number
Hamiltonian(osc, dof=1.0)                                    | dof=1.0 of Hamiltonian must be a whole number
Hamiltonian(osc, dof='1')                                    | dof='1' of Hamiltonian must be a whole number
Hamiltonian(osc, dof=None)                                   | dof=None of Hamiltonian must be a whole
Hamiltonian(osc, dof=True)                                   | dof=True of Hamiltonian must be a whole
Hamiltonian(osc, dof=[1])                                    | dof=[1] of Hamiltonian must be a whole number
Hamiltonian(osc, dof=nan)                                    | dof=nan of Hamiltonian must be a whole number
Hamiltonian(osc, dof=huge)                                   | HBVM_BENCH_MAX_COMPONENTS
Hamiltonian(osc, dof=np.array([1]))                          | dof=array([1]) of Hamiltonian must be a whole
Hamiltonian(lambda q, p, m: m.sum(lambda i: p[i]**2, iter(int, 1)), dof=2) | HBVM_BENCH_MAX_TERMS
Hamiltonian(lambda q, p, m: m.sum(lambda i: p[i]**2, 5), dof=2) | the index of m.sum is 5; give a range or a
Hamiltonian(lambda q, p, m: m.sum(lambda i: p[i]**2, None), dof=2) | m.sum needs a term and an index list;
Hamiltonian(lambda q, p, m: m.sum(lambda i: p[i]**2, [0.5]), dof=2) | the index of m.sum is not a list of
Hamiltonian(lambda q, p, m: m.sum(3, range(2)), dof=2)       | the first argument of m.sum is not a
Hamiltonian(lambda q, p, m: m.sum(lambda i: p[i]**2, range(3)), dof=2) | p[2] does not exist; p has the
Hamiltonian(lambda q, p, m: m.sum(lambda i, j: p[i]**2, range(2)), dof=2) | H failed with TypeError:
Hamiltonian(lambda q, p, m: m.sum(lambda i: p[i]**2, [huge]), dof=2) | the index of m.sum is not a list of
targets.numba(Hamiltonian(lambda q, p, m: p[0]**2 + horner(q[0], 900), dof=1), 'field') | HBVM_BENCH_MAX_DEPTH
Hamiltonian(lambda q, p, m: deep(q[0], 5000, m), dof=1)      | H failed with RecursionError: maximum
Hamiltonian(3, dof=1)                                        | H must be a function, not 3
Hamiltonian(None, dof=1)                                     | H must be a function, not None
Hamiltonian('p**2', dof=1)                                   | H must be a function, not 'p**2'
Hamiltonian(max, dof=1)                                      | H must be a function whose arguments have
Hamiltonian(np.sin, dof=1)                                   | <ufunc 'sin'>: H asks for an argument 'x';
Hamiltonian(print, dof=1)                                    | <built-in function print>: H returns nothing;
Hamiltonian(dict, dof=1)                                     | H must be a function whose arguments have
Hamiltonian(lambda q: 'a', dof=1)                            | H returns 'a', which is not a number
Hamiltonian(lambda q: None, dof=1)                           | H returns nothing; end it with a return
Hamiltonian(lambda q: [q[0]], dof=1)                         | H returns 1 values, not one number; return
Hamiltonian(lambda q: q, dof=1)                              | H returns 1 values, not one number; return
Hamiltonian(lambda q: nan, dof=1)                            | H returns nan, which is not a number
Hamiltonian(lambda q: q[0]*nan, dof=1)                       | the constant nan is not finite; use finite
Hamiltonian(lambda q: q[0]*huge, dof=1)                      | H failed with OverflowError: int too large to
Hamiltonian(lambda q: q[0]*1j, dof=1)                        | this calculates with the complex number 1j,
Hamiltonian(lambda q: q[0]+True, dof=1)                      | this calculates with True as if it were one
Hamiltonian(lambda q: q[0]**huge, dof=1)                     | H failed with OverflowError: int too large to
Hamiltonian(lambda q: q[0] if q[0] > 0 else 0, dof=1)        | this compares or branches on a symbol; the
Hamiltonian(lambda q: q[0]/0, dof=1)                         | this divides by the constant 0; divide by a
Hamiltonian(lambda q: 1/0, dof=1)                            | H failed with ZeroDivisionError: division by
Hamiltonian(lambda q, m: m.sqrt(-1.0), dof=1)                | sqrt(-1.0) is not defined; keep to the
Hamiltonian(lambda q, m: m.exp(1000.0), dof=1)               | exp(1000.0) is not defined; keep to the
Hamiltonian(lambda q, m: m.log(0), dof=1)                    | log(0.0) is not defined; keep to the
Hamiltonian(lambda q, m: m.tanhh(q[0]), dof=1)               | unknown function 'm.tanhh'; did you mean
Hamiltonian(lambda q, m: m.sin(), dof=1)                     | H failed with TypeError:
Hamiltonian(lambda q, m: m.min(q[0]), dof=1)                 | m.min has one argument; give the numbers one
Hamiltonian(lambda q, m: m.sin('a'), dof=1)                  | this calculates with 'a' as if it were one
Hamiltonian(lambda q, m: m.sin(q), dof=1)                    | this calculates with <q: 1 symbols> as if it
Hamiltonian(lambda q: np.sin(q[0]), dof=1)                   | this applies numpy's sin to a symbol; declare
Hamiltonian(lambda q: math.sin(q[0]), dof=1)                 | this needs the value of a symbol; declare the
Hamiltonian(lambda q: q[1], dof=1)                           | q[1] does not exist; q has the indices 0 to 0
Hamiltonian(lambda q: q[-2], dof=1)                          | q[-2] does not exist; q has the indices 0 to
Hamiltonian(lambda q: q['a'], dof=1)                         | q['a'] is not an index; use integers
Hamiltonian(lambda q: q[0.0], dof=1)                         | q[0.0] is not an index; use integers
Hamiltonian(lambda q: q[None], dof=1)                        | q[None] is not an index; use integers
Hamiltonian(lambda q: q[huge], dof=1)                        | q[10000000000000000000000000000000000000000000
Hamiltonian(lambda q: q @ q, dof=1)                          | this calculates with the whole vector q;
Hamiltonian(lambda q: sum(q, q), dof=1)                      | this calculates with the whole vector q;
Hamiltonian(lambda q: q[0].real, dof=1)                      | H failed with AttributeError: 'Node' object
Hamiltonian(lambda q: float(q[0]), dof=1)                    | this needs the value of a symbol; declare the
Hamiltonian(lambda q: int(q[0]), dof=1)                      | this needs the value of a symbol; declare the
Hamiltonian(lambda q: round(q[0]), dof=1)                    | this needs the value of a symbol; declare the
Hamiltonian(lambda q: max(q[0], 0), dof=1)                   | this compares or branches on a symbol; the
Hamiltonian(lambda q: f'{q[0]:.3f}', dof=1)                  | H failed with TypeError: unsupported format
Hamiltonian(lambda q: q[0]('a'), dof=1)                      | H failed with TypeError: 'Node' object is not
Hamiltonian(lambda x: x[0], dof=1)                           | H asks for an argument 'x'; name those it
Hamiltonian(lambda q, par: par.k*q[0], dof=1)                | unknown parameter 'k'; there are none;
Hamiltonian(lambda q, par: par['k']*q[0], dof=1)             | unknown parameter 'k'; there are none;
Hamiltonian(lambda q, par: par[0]*q[0], dof=1)               | par[0] is not a parameter; write par.name
Hamiltonian(lambda *a: a[0], dof=1)                          | H failed with IndexError: tuple index out of
Hamiltonian(osc, dof=1, parameters={'k': 'a'})               | parameter 'k' is 'a'; give one finite number
Hamiltonian(osc, dof=1, parameters={'k': None})              | parameter 'k' is None; give one finite number
Hamiltonian(osc, dof=1, parameters={'k': nan})               | parameter 'k' is nan; give one finite number
Hamiltonian(osc, dof=1, parameters={'k': huge})              | parameter 'k' is about 1e400; give one finite
Hamiltonian(osc, dof=1, parameters={'k': [[1, 2], [3]]})     | parameter 'k' is [[1, 2], [3]]; give one
Hamiltonian(osc, dof=1, parameters={'k': [[1, 2], [3]]})     | parameter 'k' is [[1, 2], [3]]; give one
Hamiltonian(osc, dof=1, parameters={'k': '2'})               | parameter 'k' is '2'; give one finite number
Hamiltonian(osc, dof=1, parameters={'k': []})                | parameter 'k' is []; give one finite number
Hamiltonian(osc, dof=1, parameters={'k': 1j})                | parameter 'k' is complex, and must be real; a
Hamiltonian(osc, dof=1, parameters={3: 1.0})                 | parameters={3: 1.0} of Hamiltonian must be a
Hamiltonian(osc, dof=1, parameters={'my k': 1.0})            | the parameter name 'my k' must be an
Hamiltonian(osc, dof=1, parameters=[1, 2])                   | parameters=[1, 2] of Hamiltonian must be a
Hamiltonian(osc, dof=1, parameters=3)                        | parameters=3 of Hamiltonian must be a
Hamiltonian(osc, dof=1, parameters=None)                     | parameters=None of Hamiltonian must be a
Hamiltonian(osc, dof=1, parameters='k')                      | parameters='k' of Hamiltonian must be a
Hamiltonian(osc, dof=1, invariants=osc)                      | invariants=<function osc> of Hamiltonian must
Hamiltonian(osc, dof=1, invariants=[osc])                    | invariants=[<function osc>] of Hamiltonian
Hamiltonian(osc, dof=1, invariants={'L': 3})                 | invariant 'L' must be a function, not 3
Hamiltonian(osc, dof=1, invariants={3: osc})                 | invariants={3: <function osc>} of Hamiltonian
Hamiltonian(osc, dof=1, invariants={'': osc})                | invariants={'': <function osc>} of
Hamiltonian(osc, dof=1, invariants={'energy': osc})          | the invariant 'energy' is H itself; give the
Hamiltonian(osc, dof=1, invariants={'L': lambda q: []})      | invariant 'L' returns an empty list; return a
Hamiltonian(osc, dof=1, invariants={'L': lambda q: None})    | invariant 'L' returns nothing; end it with a
Hamiltonian(osc, dof=1, invariants={'L': lambda q: 'a'})     | invariant 'L' returns 'a', which is not a
Hamiltonian(osc, dof=1, invariants=None)                     | invariants=None of Hamiltonian must be a
Hamiltonian(osc, dof=1, guards=osc)                          | guards=<function osc> of Hamiltonian must be
Hamiltonian(osc, dof=1, guards={'g': 3})                     | guard 'g' must be a function, not 3
Hamiltonian(osc, dof=1, guards={'g': lambda q: [q[0]]})      | guard 'g' returns 1 values, not one number;
Hamiltonian(osc, dof=1, bodies=3)                            | bodies=3 must be a problems.Bodies, as in
Hamiltonian(osc, dof=1, bodies='m')                          | bodies='m' must be a problems.Bodies, as in
Hamiltonian(osc, dof=1, bodies=Bodies(masses='m'))           | unknown parameter in bodies 'm'; there are
Hamiltonian(osc, dof=1, domain=3)                            | domain must be a function, not 3
Hamiltonian(osc, dof=1, domain=lambda q: 'a')                | domain returns 'a', which is not a number
Hamiltonian(osc, dof=1, name=3)                              | name=3 of Hamiltonian must be text
Hamiltonian(osc, dof=1).function('feild')                    | unknown function of osc 'feild'; did you
Hamiltonian(osc, dof=1).function(3)                          | unknown function of osc 3; known: field,
Hamiltonian(osc, dof=1).pack({'k': 1})                       | unknown parameter of osc 'k'; there are
Hamiltonian(osc, dof=1).pack(3)                              | parameters=3 of osc must be a dictionary by
VectorField(lambda y: [y[1]], dim=2)                         | f returns 1 values, not a list of dim=2;
VectorField(lambda y: y[1], dim=2)                           | f returns one value, not a list of dim=2;
VectorField(lambda y: None, dim=2)                           | f returns one value, not a list of dim=2;
VectorField(lambda y: [y[1], None], dim=2)                   | f's component 1 returns nothing; end it with
VectorField(lambda y: [y[1], 'a'], dim=2)                    | f's component 1 returns 'a', which is not a
VectorField(lambda y: [y[1], [y[0]]], dim=2)                 | f's component 1 returns 1 values, not one
VectorField(lambda y: (y[i] for i in range(2)), dim=2)       | f returns one value, not a list of dim=2;
VectorField(lambda y: np.array([y[1], y[0]]), dim=2)         | this makes a numpy array of symbols; write
VectorField(lambda y: {0: y[1], 1: y[0]}, dim=2)             | f returns one value, not a list of dim=2;
VectorField(lambda q: [q[0], q[1]], dim=2)                   | f asks for an argument 'q'; name those it
VectorField(lambda y: [y[1], -y[0]], dim=0)                  | dim=0 of VectorField must be a whole number
VectorField(lambda y: [y[1], -y[0]], dim='2')                | dim='2' of VectorField must be a whole number
VectorField(lambda y: [y[1], -y[0]], dim=2.0)                | dim=2.0 of VectorField must be a whole number
VectorField(lambda y: [y[1], -y[0]], dim=10**9)              | HBVM_BENCH_MAX_COMPONENTS
VectorField(lambda y: [y[i] for i in range(100000)], dim=100000) | HBVM_BENCH_MAX_OPERATIONS
VectorField(lambda y: [y[1], -y[0]])                         | VectorField needs dim; give a value as in
VectorField(lambda y: [y[1], -y[0]], dof=2)                  | unknown argument of VectorField 'dof'; did
VectorField(lambda y: 'ab', dim=2)                           | f returns one value, not a list of dim=2;
VectorField(3, dim=2)                                        | f must be a function, not 3
Poisson(osc, dim=3)                                          | Poisson needs B; give a value as in
Poisson(lambda y: y[0]**2, lambda y: [[0, 1], [1, 0]], dim=2) | B is not skew-symmetric as it is written:
Poisson(lambda y: y[0]**2, lambda y: [[0, 1]], dim=2)        | B must return 2 lists of 2 entries
Poisson(lambda y: y[0]**2, lambda y: None, dim=2)            | B must return 2 lists of 2 entries
Poisson(lambda y: y[0]**2, lambda y: 3, dim=2)               | B must return 2 lists of 2 entries
Poisson(lambda y: y[0]**2, lambda y: [[0, 'a'], ['b', 0]], dim=2) | B's entry [0][1] returns 'a', which is
Poisson(lambda y: y[0]**2, 3, dim=2)                         | B must be a function, not 3
Poisson(3, lambda y: [[0, 1], [-1, 0]], dim=2)               | H must be a function, not 3
Poisson(lambda y: y[0]**2, lambda y: [[0, 1], [-1, 0]], dim=2.0) | dim=2.0 of Poisson must be a whole number
Poisson(lambda y: y[0]**2, lambda y: [[0, 1], [-1, 0]], dim=10**6) | HBVM_BENCH_MAX_COMPONENTS
Poisson(lambda y: y[0]**2, lambda y: np.array([[0, 1], [-1, 0]]), dim=2) | B must return 2 lists of 2
Poisson(lambda y: y[0]**2, lambda y: [[1, 1], [-1, 0]], dim=2) | B is not skew-symmetric as it is written:
Poisson(lambda q: q[0]**2, lambda y: [[0, 1], [-1, 0]], dim=2) | H asks for an argument 'q'; name those it
Opaque(3, dim=2)                                            | f must be a function, not 3
Opaque(lambda t: t, dim=2)                                  | a field has the arguments (t, y), (t, y, dy),
Opaque(lambda t, y, a, b: t, dim=2)                         | a field has the arguments (t, y), (t, y, dy),
Opaque(lambda t, y: y, dim='a')                             | dim='a' of Opaque must be a whole number of
Opaque(lambda t, y: y)                                      | Opaque needs dim; give a value as in
Opaque(lambda t, y: y, dim=10**9)                           | HBVM_BENCH_MAX_COMPONENTS
"""

PROBLEMS = r"""
Problem()                                                    | Problem needs system, t_end; give a value as
Problem(H1)                                                  | Problem needs t_end; give a value as in
Problem(H1, q0=[0], p0=[1])                                  | Problem needs t_end; give a value as in
Problem(H1, [0], [1], t_end=1.)                              | Problem takes only system by place and the
Problem(H1, x0=[0], t_end=1.)                                | unknown argument of Problem 'x0'; did you
Problem(3, y0=[1], t_end=1.)                                 | a Problem needs a Hamiltonian or a
Problem(osc, q0=[0], p0=[1], t_end=1.)                       | a Problem needs a Hamiltonian or a
Problem(Hamiltonian, q0=[0], p0=[1], t_end=1.)               | a Problem needs a Hamiltonian or a
Problem('kepler', t_end=1.)                                  | a Problem needs a Hamiltonian or a
Problem(H1, t_end=1.)                                        | give the start as q0= and p0=, or q0= and
Problem(H1, q0=[0], t_end=1.)                                | give the start as q0= and p0=, or q0= and
Problem(H1, q0=[0], p0=[1], v0=[1], t_end=1.)                | give the start as q0= and p0=, or q0= and
Problem(H1, q0=[0], p0=[1], y0=[0, 1], t_end=1.)             | give the start as q0= and p0=, or q0= and
Problem(H1, q0=[0, 1], p0=[1], t_end=1.)                     | q0 must be a flat list of length 1, not an
Problem(H1, q0=[0], p0=[], t_end=1.)                         | p0 must be a flat list of length 1, not an
Problem(H1, q0=0, p0=1, t_end=1.)                            | q0 must be a flat list of length 1, not an
Problem(H1, q0='a', p0=[1], t_end=1.)                        | q0 must be numbers, not 'a'
Problem(H1, q0=['a'], p0=[1], t_end=1.)                      | q0 must be numbers, not ['a']
Problem(H1, q0=[nan], p0=[1], t_end=1.)                      | q0 must be finite, not [nan]
Problem(H1, q0=[inf], p0=[1], t_end=1.)                      | q0 must be finite, not [inf]
Problem(H1, q0=[huge], p0=[1], t_end=1.)                     | q0 must be numbers, not
Problem(H1, q0=[1j], p0=[1], t_end=1.)                       | q0 is complex, and must be real; a complex
Problem(H1, q0=[None], p0=[1], t_end=1.)                     | q0 must be finite, not [nan]
Problem(H1, q0={}, p0=[1], t_end=1.)                         | q0 must be numbers, not {}
Problem(H1, q0=[[0]], p0=[1], t_end=1.)                      | q0 must be a flat list of length 1, not an
Problem(H1, q0=(i for i in [0]), p0=[1], t_end=1.)           | q0 must be numbers, not <generator object
Problem(H1, y0=[1, 2, 3], t_end=1.)                          | y0 must be a flat list of length 2, not an
Problem(H1, y0='ab', t_end=1.)                               | y0 must be numbers, not 'ab'
Problem(V2, q0=[1], p0=[1], t_end=1.)                        | a VectorField starts from y0=, of length 2;
Problem(V2, t_end=1.)                                        | a VectorField starts from y0=, of length 2;
Problem(V2, y0=[0, 1], t_end='a')                            | t_end='a' of Problem must be a finite number
Problem(V2, y0=[0, 1], t_end=None)                           | t_end=None of Problem must be a finite number
Problem(V2, y0=[0, 1], t_end=nan)                            | t_end=nan of Problem must be a finite number
Problem(V2, y0=[0, 1], t_end=inf)                            | t_end=inf of Problem must be a finite number
Problem(V2, y0=[0, 1], t_end=huge)                           | t_end=about 1e400 of Problem must be a finite
Problem(V2, y0=[0, 1], t_end=[1, 2])                         | t_end=[1, 2] of Problem must be a finite
Problem(V2, y0=[0, 1], t_end='1')                            | t_end='1' of Problem must be a finite number
Problem(V2, y0=[0, 1], t_end=1., references=[1])             | references=[1] of Problem must be a list of
targets.numba(P1, 'field')                                      | a system is needed, such as problem.system
Hamiltonian(osc, dof=1, parameters={'m': [1]}, bodies=Bodies()) | does not fit dof=1 and m=(1.0,)
Problem(V2, y0=[0, 1], t_end=1j)                             | t_end=1j of Problem is complex, and must be
Problem(V2, y0=[0, 1], t0='a', t_end=1.)                     | t0='a' of Problem must be a finite number
Problem(V2, y0=[0, 1], t0=None, t_end=1.)                    | t0=None of Problem must be a finite number
Problem(V2, y0=[0, 1], t_end=1., parameters={'k': 3})        | unknown parameter of system 'k'; there are
Problem(V2, y0=[0, 1], t_end=1., parameters=[3])             | parameters=[3] of Problem must be a
Problem(V2, y0=[0, 1], t_end=1., parameters=None)            | parameters=None of Problem must be a
Problem(V2, y0=[0, 1], t_end=1., parameters={'k': 'a'})      | unknown parameter of system 'k'; there are
Problem(V2, y0=[0, 1], t_end=1., times='a')                  | times must be numbers, not 'a'
Problem(V2, y0=[0, 1], t_end=1., times=[nan])                | times must be finite, not [nan]
Problem(V2, y0=[0, 1], t_end=1., times=[[0, 1]])             | times must be a flat list, not an array of
Problem(V2, y0=[0, 1], t_end=1., name=3)                     | name=3 of Problem must be text
Problem(V2, y0=[0, 1], t_end=1., title=3)                    | title=3 of Problem must be text
Problem(V2, y0=[0, 1], t_end=1., arguments=3)                | arguments=3 of Problem must be a dictionary
Problem(V2, y0=[0, 1], t_end=1., references=3)               | references=3 of Problem must be a list of
Problem(V2, y0=[0, 1], t_end=1., references='abc').references | references='abc' of Problem must be a list of
"""


@pytest.mark.parametrize("fault", faults(BY_NAME + SYSTEMS + PROBLEMS), ids=str)
def test_one_sentence(fault: Fault):
    is_met(fault)
