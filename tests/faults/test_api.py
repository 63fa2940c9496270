"""What is wrong with methods, events and calls of integrate, and what is said about it."""

import copy
import dataclasses
import inspect
import pickle
import pydoc

import pytest

import integrators
import problems
from integrators import HBVM, Gauss
from problems.errors import InputError

from .fault import Fault, is_met
from .typed import faults, names

OURS = r"""
HBVM(1, 2)                                                   | HBVM takes its options by name, not 1; write
HBVM(kk=3)                                                   | unknown option of HBVM 'kk'; did you mean
HBVM(k=4, s=2, step=.1)                                      | unknown option of HBVM 'step'; did you mean
Gauss(h=.1)                                                  | Gauss needs s; give a value as in
HBVM(k='4', s=2, h=.1)                                       | k='4' of HBVM must be a whole number of at lea
HBVM(k=4.0, s=2, h=.1)                                       | k=4.0 of HBVM must be a whole number of at lea
HBVM(k=True, s=True, h=.1)                                   | k=True of HBVM must be a whole number of at le
HBVM(k=[4], s=2, h=.1)                                       | k=[4] of HBVM must be a whole number of at lea
HBVM(k=np.array([4]), s=2, h=.1)                             | k=array([4]) of HBVM must be a whole number of
HBVM(k=nan, s=2, h=.1)                                       | k=nan of HBVM must be a whole number of at lea
HBVM(k=-4, s=2, h=.1)                                        | k=-4 of HBVM must be a whole number of at leas
HBVM(k=0, s=0, h=.1)                                         | k=0 of HBVM must be a whole number of at least
HBVM(k=2000, s=2, h=.1)                                      | HBVM_BENCH_MAX_STAGES
HBVM(k=huge, s=2, h=.1)                                      | HBVM_BENCH_MAX_STAGES
HBVM(k=4, s=2, h='0.1')                                      | h='0.1' of HBVM must be a finite step above 0;
HBVM(k=4, s=2, h=nan)                                        | h=nan of HBVM must be a finite step above 0; t
HBVM(k=4, s=2, h=inf)                                        | h=inf of HBVM must be a finite step above 0; t
HBVM(k=4, s=2, h=-.1)                                        | h=-0.1 of HBVM must be a finite step above 0;
HBVM(k=4, s=2, h=0)                                          | h=0 of HBVM must be a finite step above 0; the
HBVM(k=4, s=2, h=True)                                       | h=True of HBVM must be a finite step above 0;
HBVM(k=4, s=2, h=huge)                                       | h=about 1e400 of HBVM must be a finite step ab
HBVM(k=4, s=2, h=[.1])                                       | h=[0.1] of HBVM must be a finite step above 0;
HBVM(k=4, s=2, h=np.array([.1, .2]))                         | h=array([0.1, 0.2]) of HBVM must be a finite s
HBVM(k=4, s=2, h=np.array([.1]))                             | h=array([0.1]) of HBVM must be a finite step a
HBVM(k=4, s=2, h=1j)                                         | h=1j of HBVM is complex, and must be real
HBVM(k=4, h=.1)                                              | HBVM needs s with k=4; give s too
HBVM(h=.1)                                                   | HBVM needs k and s with a fixed step, h=0.1;
HBVM(tol=0)                                                  | tol=0 of HBVM must be a tolerance from 2.2e-16
HBVM(tol=1)                                                  | tol=1 of HBVM must be a tolerance from 2.2e-16
HBVM(tol=-1e-9)                                              | tol=-1e-09 of HBVM must be a tolerance from 2.
HBVM(tol=1e-17)                                              | tol=1e-17 of HBVM must be a tolerance from 2.2
HBVM(tol='1e-9')                                             | tol='1e-9' of HBVM must be a tolerance from 2.
HBVM(tol=nan)                                                | tol=nan of HBVM must be a tolerance from 2.2e-
HBVM(tol=huge)                                               | tol=about 1e400 of HBVM must be a tolerance fr
HBVM(tol=[1e-9])                                             | tol=[1e-09] of HBVM must be a tolerance from 2
HBVM(k=1, s=1, tol=1e-9)                                     | HBVM needs k > 1 with a tolerance: one stage
HBVM(solver='newtn')                                         | unknown solver of HBVM 'newtn'; did you mean '
HBVM(solver=None)                                            | unknown solver of HBVM None; known: auto, blen
HBVM(solver=3)                                               | unknown solver of HBVM 3; known: auto, blended
HBVM(solver=['newton'])                                      | unknown solver of HBVM ['newton']; did you mea
HBVM(solver=np.array([1,2]))                                 | unknown solver of HBVM array([1, 2]); known: a
HBVM(solver={})                                              | unknown solver of HBVM {}; known: auto, blende
HBVM(k=2, s=3, h=.1)                                         | HBVM needs k >= s; k=2 is less than s=3:
Gauss(s=2)                                                   | Gauss needs a step h, or a tolerance tol for
Gauss(s=0, h=.1)                                             | s=0 of Gauss must be a whole number of at leas
Gauss(s=2.5, h=.1)                                           | s=2.5 of Gauss must be a whole number of at le
Gauss(s=300, h=.1)                                           | HBVM_BENCH_MAX_STAGES
Gauss(s=1, tol=1e-6)                                         | Gauss needs k > 1 with a tolerance: one stage
Gauss(s=2, h=.1, k=3)                                        | unknown option of Gauss 'k'; known: atol, break
Gauss(s=2, h=.1, solver='x')                                 | unknown solver of Gauss 'x'; known: auto, blen
Gauss(2, .1)                                                 | Gauss takes its options by name, not 2; write
LineIntegral(k=4, s=2, h=.1)                                 | LineIntegral needs invariants; give a value
LineIntegral(k=2, s=2, h=.1, invariants=['energy'])          | LineIntegral needs k > s, not k=2, s=2: 2
LineIntegral(k=4, s=2, h=.1, invariants='energy')            | invariants='energy' of LineIntegral must be a
LineIntegral(k=4, s=2, h=.1, invariants=[])                  | invariants=[] of LineIntegral must be a list o
LineIntegral(k=4, s=2, h=.1, invariants=[1])                 | invariants=[1] of LineIntegral must be a list
LineIntegral(k=4, s=2, h=.1, invariants=['energy', 'energy']) | invariants=['energy', 'energy'] of LineIntegra
LineIntegral(k=4, s=2, h=.1, invariants=None)                | invariants=None of LineIntegral must be a list
LineIntegral(k=4, s=2, invariants=['energy'])                | LineIntegral needs a step h, or a tolerance
LineIntegral(k=400, s=2, h=.1, invariants=['energy'])        | HBVM_BENCH_MAX_STAGES
"""

PEERS = r"""
Taylor(tol=0)                                                | tol=0 of Taylor must be a number between 0 and
Taylor(tol=-1)                                               | tol=-1 of Taylor must be a number between 0 an
Taylor(tol='a')                                              | tol='a' of Taylor must be a number between 0 a
Taylor(tol=None)                                             | tol=None of Taylor must be a number between 0
Taylor(tol=nan)                                              | tol=nan of Taylor must be a number between 0 a
Taylor(tol=huge)                                             | tol=about 1e400 of Taylor must be a number bet
Taylor(tol=1e-15, compact_mode='yes')                        | compact_mode='yes' of Taylor must be True or F
Taylor(tol=1e-15, compact_mode=None)                         | compact_mode=None of Taylor must be True or Fa
Taylor(high_accuracy=2)                                      | high_accuracy=2 of Taylor must be True or Fals
Taylor(fast_math=np.array([1,0]))                            | fast_math=array([1, 0]) of Taylor must be True
Taylor(fast_math=[])                                         | fast_math=[] of Taylor must be True or False.
Taylor(toll=1)                                               | unknown option of Taylor 'toll'; did you mean
Taylor(1e-15)                                                | Taylor takes its options by name, not 1e-15;
IAS15(epsilon=-1)                                            | epsilon=-1 of IAS15 must be a finite number of
IAS15(epsilon='x')                                           | epsilon='x' of IAS15 must be a finite number o
IAS15(epsilon=nan)                                           | epsilon=nan of IAS15 must be a finite number o
IAS15(mode='globl')                                          | unknown mode of IAS15 'globl'; did you mean
IAS15(mode=1)                                                | unknown mode of IAS15 1; known: aarseth85,
IAS15(mode=np.array(['global','prs23']))                     | unknown mode of IAS15 array(['global',
IAS15(min_dt=-1)                                             | min_dt=-1 of IAS15 must be a finite number of
IAS15(min_dt=inf)                                            | min_dt=inf of IAS15 must be a finite number of
IAS15(h=-1)                                                  | h=-1 of IAS15 must be a finite step above 0; t
IAS15(h='a')                                                 | h='a' of IAS15 must be a finite step above 0;
IAS15(h=huge)                                                | h=about 1e400 of IAS15 must be a finite step a
IAS15(epsilom=1)                                             | unknown option of IAS15 'epsilom'; did you
WHFast()                                                     | WHFast needs h; give a value as in
WHFast(h=0)                                                  | h=0 of WHFast must be a finite step above 0; t
WHFast(h=nan)                                                | h=nan of WHFast must be a finite step above 0;
WHFast(h=.1, coordinates='jakobi')                           | unknown coordinates of WHFast 'jakobi'; did
WHFast(h=.1, coordinates=None)                               | unknown coordinates of WHFast None; known:
WHFast(h=.1, corrector=4)                                    | corrector=4 of WHFast must be one of 0, 3, 5,
WHFast(h=.1, corrector='3')                                  | corrector='3' of WHFast must be one of 0, 3, 5
WHFast(h=.1, corrector=3.0)                                  | corrector=3.0 of WHFast must be one of 0, 3, 5
WHFast(h=.1, corrector=True)                                 | corrector=True of WHFast must be one of 0, 3,
WHFast(h=.1, corrector2='yes')                               | corrector2='yes' of WHFast must be True or Fal
WHFast(h=.1, kernel='lzy')                                   | unknown kernel of WHFast 'lzy'; did you mean
WHFast(h=.1, kernel='lazy', coordinates='whds')              | WHFast has kernel='lazy' in
WHFast(h=.1, corrector2=True, coordinates='whds')            | WHFast has corrector2=True in
WHFast(h=.1, body_order=3)                                   | body_order=3 of WHFast must be a list that nam
WHFast(h=.1, body_order=[0, 0])                              | body_order=[0, 0] of WHFast must be a list tha
WHFast(h=.1, body_order='abc')                               | body_order='abc' of WHFast must be a list that
WHFast(h=.1, body_order=[0.5, 1])                            | body_order=[0.5, 1] of WHFast must be a list t
WHFast(h=.1, body_order=[])                                  | body_order=[] of WHFast must be a list that na
WHFast(h=.1, body_order=[1, 2])                              | body_order=[1, 2] of WHFast must be a list tha
WHFast512(h='a')                                             | h='a' of WHFast512 must be a finite step above
WHFast512(h=.1, corrector=1)                                 | corrector=1 of WHFast512 must be one of 0, 17.
WHFast512(h=.1, corrector=-3)                                | corrector=-3 of WHFast512 must be one of 0, 17
Leapfrog(h=.1, order=3)                                      | order=3 of Leapfrog must be one of 2, 4, 6, 8.
Leapfrog(h=.1, order='2')                                    | order='2' of Leapfrog must be one of 2, 4, 6,
Leapfrog(h=.1, order=None)                                   | order=None of Leapfrog must be one of 2, 4, 6,
Leapfrog(h=None)                                             | h=None of Leapfrog must be a finite step above
Leapfrog()                                                   | Leapfrog needs h; give a value as in
LeapfrogMidpoint(h=nan)                                      | h=nan of LeapfrogMidpoint must be a finite ste
ReversibleHeun(h=-.1)                                        | h=-0.1 of ReversibleHeun must be a finite step
SemiImplicitEuler(h='1')                                     | h='1' of SemiImplicitEuler must be a finite st
DOP853()                                                     | DOP853 needs rtol, atol; give a value as in
DOP853(rtol=1e-9)                                            | DOP853 needs atol; give a value as in
DOP853(rtol=0, atol=0)                                       | rtol=0 of DOP853 must be a number between 0 an
DOP853(rtol=-1, atol=1)                                      | rtol=-1 of DOP853 must be a number between 0 a
DOP853(rtol='a', atol=1e-9)                                  | rtol='a' of DOP853 must be a number between 0
DOP853(rtol=1e-9, atol=nan)                                  | atol=nan of DOP853 must be a finite number of
DOP853(rtol=1e-9, atol=[1e-9,1e-9])                          | atol=[1e-09, 1e-09] of DOP853 must be a finite
DOP853(rtol=1e-20, atol=1e-9)                                | rtol=1e-20 is below what SciPy attains (100
DOP853(rtol=inf, atol=1e-9)                                  | rtol=inf of DOP853 must be a number between 0
Radau(rtol=1e-9, atol=None)                                  | atol=None of Radau must be a finite number of
Radau(rtol=1e-9, atol=1e-9, max_step=1)                      | unknown option of Radau 'max_step'; known:
Dopri8()                                                     | Dopri8 needs either h, as in Dopri8(h=0.1),
Dopri8(h=.1, rtol=1e-9)                                      | Dopri8 needs either h, as in Dopri8(h=0.1),
Dopri8(rtol=1e-9)                                            | Dopri8 needs either h, as in Dopri8(h=0.1),
Dopri8(h='a')                                                | h='a' of Dopri8 must be a finite step above 0;
Dopri8(rtol=2, atol=huge)                                    | rtol=2 of Dopri8 must be a number between 0 an
"""

CALLS = r"""
registry.create('HBVN')                                      | unknown method 'HBVN'; did you mean 'HBVM'?
registry.create('HBVM', kk=3)                                | unknown option of HBVM 'kk'; did you mean
registry.create('Gauss')                                     | Gauss needs s; give a value as in
registry.create(3)                                           | unknown method 3; known: BDF, BS, CVODE, Com
registry.create(None)                                        | unknown method None; known: BDF, BS, CVODE, Com
registry.get([1])                                            | unknown method [1]; known: BDF, BS, CVODE, Com
Event(3)                                                     | an event needs a function g, not 3
Event(None)                                                  | an event needs a function g, not None
Event()                                                      | Event needs g; give a value as in
Event(osc, 1)                                                | Event takes only g by place and the rest by
Event(osc, direction=2)                                      | direction=2 of Event must be 1, -1 or 0
Event(osc, direction='up')                                   | direction='up' of Event must be 1, -1 or 0
Event(osc, direction=np.array([1, 0]))                       | direction=array([1, 0]) of Event must be
Event(osc, direction=None)                                   | direction=None of Event must be 1, -1 or 0
Event(osc, direction=nan)                                    | direction=nan of Event must be 1, -1 or 0
Event(osc, direction=huge)                                   | direction=about 1e400 of Event must be 1,
Event(osc, terminal=-1)                                      | terminal=-1 of Event must be True, False,
Event(osc, terminal='yes')                                   | terminal='yes' of Event must be True,
Event(osc, terminal=1.5)                                     | terminal=1.5 of Event must be True, False,
Event(osc, terminal=None)                                    | terminal=None of Event must be True,
Event(osc, terminal=huge)                                    | terminal=about 1e400 of Event must be
Event(osc, name=3)                                           | name=3 of Event must be a text
Event(osc, name='')                                          | name='' of Event must be a text
Event(osc, dirction=1)                                       | unknown option of Event 'dirction'; did you
integrate(P1, 'HBVM')                                        | method must be a method such as HBVM(k=8,
integrate('kepler', M1)                                      | problem must be a Problem, not 'kepler'; make
integrate(M1, P1)                                            | problem must be a Problem, not HBVM(k=4, s=2,
integrate(P1, HBVM)                                          | method must be a method such as HBVM(k=8,
integrate(problems.load, M1)                                 | problem must be a Problem, not <function
integrate(P1, M1, times='abc')                               | times must be numbers, not 'abc'
integrate(P1, M1, times=[0, nan])                            | times must be finite numbers
integrate(P1, M1, times=[0, inf])                            | times must be finite numbers
integrate(P1, M1, times=[0, 1, 1])                           | times must be strictly monotone; times[1]
integrate(P1, M1, times=[1, 0])                              | times must be strictly monotone and ahead of
integrate(P1, M1, times=[0, 1, .5])                          | times must be strictly monotone; times[1]
integrate(P1, M1, times=[[0, 1]])                            | times must be a non-empty one-dimensional
integrate(P1, M1, times=[[0], [1, 2]])                       | times must be numbers, not [[0], [1, 2]]
integrate(P1, M1, times=[0, 1j])                             | times is complex, and must be real
integrate(P1, M1, times=['a', 'b'])                          | times must be numbers, not ['a', 'b']
integrate(P1, M1, times=huge)                                | times must be numbers, not about 1e400
integrate(P1, M1, times=[0, huge])                           | times must be numbers, not [0,
integrate(P1, M1, times={0, 1})                              | times must be numbers, not {0, 1}
integrate(P1, M1, times=(i for i in range(3)))               | times must be numbers, not <generator object
integrate(P1, M1, times=[None, 1])                           | times must be finite numbers
integrate(P1, M1, times=P1)                                  | times must be numbers, not
integrate(P1, M1, smaple='partial')                          | unknown argument of integrate 'smaple'; did you
integrate()                                                  | integrate needs problem; give a value as in
integrate(P1, M1, [0, 1], None, (), True)                    | integrate takes only problem, method, times,
integrate(P1, M1, method=M1)                                 | integrate gets method twice, by place and by
integrate_many(P1, M1, thread=2)                             | unknown argument of integrate_many 'thread';
section(P1, M1, osc, cuont=2)                                | unknown argument of section 'cuont'; did you
integrators.load('a', problme=P1)                               | unknown argument of load 'problme'; did you
integrate(P1, M1, sample='partail')                          | unknown sample of integrate 'partail'; did yo
integrate(P1, M1, sample=3)                                  | unknown sample of integrate 3; known: dense,
integrate(P1, M1, sample=['partial'])                        | unknown sample of integrate ['partial']; did
integrate(P1, M1, sample=np.array([1,2]))                    | unknown sample of integrate array([1, 2]); kn
integrate(P1, M1, events=3)                                  | an event needs a function g, not 3
integrate(P1, M1, events='q[0]')                             | an event needs a function g, not 'q'
integrate(P1, M1, events=None)                               | an event needs a function g, not None
integrate(P1, M1, events=[None])                             | an event needs a function g, not None
integrate(P1, M1, events={'a': osc})                         | an event needs a function g, not {'a':
integrate(P1, M1, events=lambda q: 'a')                      | event 'event' returns 'a', which is not a
integrate(P1, M1, events=lambda q: None)                     | event 'event' returns nothing; end it with a
integrate(P1, M1, events=lambda q: [q[0], q[0]])             | event 'event' returns 2 values, not one
integrate(P1, M1, events=lambda q: q[3])                     | q[3] does not exist; q has the indices 0 to 0
integrate(P1, M1, events=Event)                              | <class 'integrators.events.event.Event'>:
integrate(P1, M1, events=np.sin)                             | <ufunc 'sin'>: event 'sin' asks for an
integrate(P1, M1, events=osc, sample='stop')                 | events are located on the method's steps,
section(P1, M1, 3)                                           | an event needs a function g, not 3
section(P1, M1, osc, direction=3)                            | direction=3 of Event must be 1, -1 or 0
section(P1, M1, osc, count=0)                                | count=0 of section must be a whole number of
section(P1, M1, osc, count='a')                              | count='a' of section must be a whole number
section(P1, M1, osc, count=True)                             | count=True of section must be a whole number
section(P1, M1, osc, count=1.5)                              | count=1.5 of section must be a whole number
section(P1, M1, osc, count=huge)                             | terminal=about 1e400 of Event must be
section(P1, M1, osc, t_end='a')                              | t_end='a' of section must be a finite number
section(P1, M1, osc, t_end=nan)                              | t_end=nan of section must be a finite number
section(P1, M1, osc, t_end=0.)                               | t_end=0.0 of a section must be another time
section(P1, M1, osc, t_end=[1, 2])                           | t_end=[1, 2] of section must be a finite
section(P1, M1, osc, t_end=huge)                             | t_end=about 1e400 of section must be a finite
section(P1, 'HBVM', osc)                                     | method must be a method such as HBVM(k=8,
integrate(F(lambda t, y: [1]), M1)                           | system returns an array of shape (1,), not
integrate(F(lambda t, y: 'ab'), M1)                          | what system returns must be numbers, not 'ab'
integrate(F(lambda t, y: None), M1)                          | system returns an array of shape (), not
integrate(F(lambda t, y: {}), M1)                            | what system returns must be numbers, not {}
integrate(F(lambda t, y: [huge, 1]), M1)                     | system returns
integrators.order_of(3)                                      | 3 is no Runge-Kutta method whose coefficients
integrators.stability(3, 1)                                  | 3 is no Runge-Kutta method whose coefficients
integrate(P1, M1, times=np.broadcast_to(0., 10**10))         | HBVM_BENCH_MAX_GIB
integrate_many(H1, M1, starts=[[0, 1]])                      | problem must be a Problem, not
integrate_many(P1, 3, starts=[[0, 1]])                       | method must be a method such as HBVM(k=8,
integrate_many(P1, M1)                                       | integrate_many needs starts=, an array (n, dim
integrate_many(P1, M1, starts='a')                           | starts must be numbers, not 'a'
integrate_many(P1, M1, starts=3)                             | starts must have shape (n, 2) with n >= 1, not
integrate_many(P1, M1, starts=[0, 1])                        | starts must have shape (n, 2) with n >= 1, not
integrate_many(P1, M1, starts=[])                            | starts must have shape (n, 2) with n >= 1, not
integrate_many(P1, M1, starts=[[0, 1, 2]])                   | starts must have shape (n, 2) with n >= 1, not
integrate_many(P1, M1, starts=[[0, nan]])                    | the initial state must be finite numbers;
integrate_many(P1, M1, starts=[[0, 1]], times='a')           | times must be numbers, not 'a'
integrate_many(P1, M1, starts=[[0, 1]], times=[1, 0])        | times must be strictly monotone and ahead of
integrate_many(P1, M1, starts=[[0, 1]], threads=0)           | threads=0 of integrate_many must be a whole
integrate_many(P1, M1, starts=[[0, 1]], progress=3)          | progress=3 must be True, False or a function
integrate_many(P1, M1, starts=[[0, 1]], threads=1.5)         | threads=1.5 of integrate_many must be a whole
integrate_many(P1, M1, starts=[[0, 1]], parameters={'b': 1}) | unknown parameter of
integrate_many(P1, M1, starts=[[0, 1]], parameters=[1])      | parameters=[1] of integrate_many must be
integrate_many(K1, M1, starts=[K1.y0], parameters={'mu': 'a'}) | values of parameter 'mu' must be numbers, not
integrate_many(K1, M1, starts=[K1.y0], parameters={'nu': 1}) | unknown parameter of spring 'nu'; did you mean
integrate_many(K1, M1, starts=[K1.y0], parameters={'mu': [1, 2]}) | parameter 'mu' has 2 values, and starts 1;
integrate_many(K1, M1, parameters={'mu': [[1, 2]]})          | parameter 'mu' must have shape (n,), not (1, 2)
integrate_many(K1, M1, starts=[K1.y0], parameters={'mu': [nan]}) | parameter 'mu' must be finite numbers; got
integrate_many(K1, M1, starts=np.broadcast_to(K1.y0, (10**7, 2)), times=np.arange(200.)) | HBVM_BENCH_MAX_GIB
"""

STATES = r"""
P1.invariants('a')                                           | states must be an array of numbers, not 'a'
P1.invariants([1, 2, 3])                                     | states must have the shape (n, 2), not (3,)
P1.invariants([[1, 2, 3]])                                   | states must have the shape (n, 2), not (1, 3)
P1.invariants(None)                                          | states must have the shape (n, 2), not ()
P1.invariants([[1, 2]], t='a')                               | t must be 1 times, not 'a'
P1.invariants([[1, 2]], t=[1, 2])                            | t must be 1 times, one per state, not of
P1.errors('a')                                               | states must be an array of numbers, not 'a'
P1.guards([1])                                               | states must have the shape (n, 2), not (1,)
P1.velocity([1, 2, 3])                                       | states must have the shape (n, 2), not (3,)
P1.velocity('a')                                             | states must be an array of numbers, not 'a'
M1.compile(H1).batch('a', times=[0, 1])                      | Y0 must be numbers, not 'a'
M1.compile(H1).batch([[0, 1]], times='a')                    | times must be numbers, not 'a'
M1.compile(H1).batch([[0, 1]], times=[0, 1], threads=0)      | threads=0 of a batch must be a whole number of
M1.compile(H1).batch([[0, 1]], times=[0, 1], threads=-1)     | threads=-1 of a batch must be a whole number o
M1.compile(H1).batch([[0, 1]], times=[0, 1], threads=1.5)    | threads=1.5 of a batch must be a whole number
M1.compile(H1).batch([[0, 1]], times=[0, 1], threads=None)   | threads=None of a batch must be a whole number
M1.compile(H1).batch([[0, 1]], times=[0, 1], threads='2')    | threads='2' of a batch must be a whole number
M1.compile(H1).batch([[0, 1]], times=[0, 1], sample='x')     | unknown sampling of a batch 'x'; known:
M1.compile(H1).batch([[0, 1]], times=[0, 1], sample=['x'])   | unknown sampling of a batch ['x']; known:
M1.compile(H1).batch([[0, 1]], [1.], times=[0, 1])           | par must have shape (0,), not (1,); see
M1.compile(H1).batch([[0, 1]], 'a', times=[0, 1])            | par must be numbers, not 'a'
M1.compile(H1).batch([[0, 1]], times=[0, 1], t0='a')         | t0 must be numbers, not 'a'
M1.compile(H1).batch([[0, 1]], times=[0, 1], t0=nan)         | t0=nan must be one finite number
M1.compile(H1).batch([[0, 1, 2]], times=[0, 1])              | the initial state must have shape (2,), not
M1.compile(H1).batch([[nan, 1]], times=[0, 1])               | the initial state must be finite numbers;
M1.compile(H1).batch([], times=[0, 1])                       | the initial state must have shape (2,), not
M1.compile(H1).batch([[[0, 1]]], times=[0, 1])               | Y0 must have shape (n, 2) with n >= 1, not
M1.compile(H1).batch(np.broadcast_to([0., 1.], (10**7, 2)), times=np.arange(200.)) | HBVM_BENCH_MAX_GIB
M1.compile(H1).start('a')                                    | the initial state must be numbers, not 'a'
M1.compile(H1).start([0, 1, 2])                              | the initial state must have shape (2,), not
M1.compile(H1).start([0, nan])                               | the initial state must be finite numbers;
M1.compile(H1).start([0, 1], 'a')                            | par must be numbers, not 'a'
M1.compile(H1).start([0, 1], [1.])                           | par must have shape (0,), not (1,); see
M1.compile(H1).start([0, 1], None, 'a')                      | t0 must be numbers, not 'a'
M1.compile(H1).start([0, 1], None, nan)                      | t0=nan must be one finite number
M1.compile(H1).start([0, 1]).advance('a')                    | times must be numbers, not 'a'
M1.compile(H1).start([0, 1]).advance([])                     | times must be a non-empty one-dimensional
M1.compile(H1).start([0, 1]).advance([-1, 1])                | times must be strictly monotone and ahead of
M1.compile(H1).start([0, 1]).advance([0, 1], sample=3)       | unknown sampling 3; known: dense, partial,
"""


@pytest.mark.parametrize("fault", faults(OURS + PEERS + CALLS + STATES), ids=str)
def test_one_sentence(fault: Fault):
    is_met(fault)


@pytest.mark.parametrize(
    ("code", "printed"),
    [
        ("HBVM(k=np.int64(4), s=np.int32(2), h=np.float32(.5))", "HBVM(k=4, s=2, h=0.5)"),
        ("Taylor(fast_math=np.bool_(True))", "Taylor(fast_math=True)"),
        ("Event(osc, direction=np.int64(1)).direction", "1"),
        ("Event(osc, terminal=np.bool_(True)).last", "1"),
        ("load('kepler', e=np.float64(.5))", "kepler(e=0.5)"),
        ("load('fput', n=np.int32(8))", "fput(n=8, alpha=0.25, beta=0.0)"),
        ("load('expression', q0=np.array([.5])).y0.tolist()", "[0.5, 1.9]"),
        ("Hamiltonian(osc, dof=np.int32(1)).function('field') and 1", "1"),
        ("Hamiltonian(osc, dof=np.int32(1)).dim", "2"),
        ("VectorField(lambda y: [y[1], -y[0]], dim=np.int64(2))", "VectorField(system, dim=2)"),
        ("Problem(V2, y0=np.ones(2), t_end=np.int32(3)).t_end", "3.0"),
        ("M1.compile(H1).batch([[0, 1]], times=[0, 1], threads=10**9).status[0].value", "'finished'"),
    ],
)
def test_numbers_of_numpy_are_numbers(code, printed):
    assert repr(eval(code, names())) == printed  # noqa: S307


@pytest.mark.parametrize("method", [HBVM(k=4, s=2, h=0.1), Gauss(s=2, tol=1e-6)], ids=repr)
def test_methods_are_copied_and_pickled(method):
    assert copy.copy(method) == copy.deepcopy(method) == pickle.loads(pickle.dumps(method)) == method
    assert dataclasses.replace(method, s=3).s == 3


def test_help_shows_the_options_and_their_types():
    assert str(inspect.signature(Gauss)).startswith("(*, s: int, h: float | None = None, tol: float | None")
    shown = str(inspect.signature(integrators.integrate))
    assert "times: ArrayLike | None = None" in shown
    assert "checkpoint: str | PathLike[str] | None = None" in shown
    assert "progress: bool | Callable[[Progress], object] = False" in shown
    assert shown.endswith(" -> Solution")


@pytest.mark.parametrize(
    "public",
    [
        *(HBVM, Gauss, integrators.integrate, integrators.integrate_many, integrators.advise),
        *(integrators.Solution, problems.Problem, problems.Hamiltonian, problems.VectorField),
    ],
    ids=lambda public: public.__name__,
)
def test_help_is_for_reading(public):
    text = pydoc.plain(pydoc.render_doc(public))
    assert "<function" not in text
    assert "object at 0x" not in text
    call = next(line for line in text.splitlines() if f"{public.__name__}(" in line and "class" not in line)
    assert len(call) < 700  # integrate_many has 597
    assert not [word for word in ("Annotated", "numpy.", "typing.", "<class") if word in call]


def test_a_limit_can_be_raised(monkeypatch):
    monkeypatch.setenv("HBVM_BENCH_MAX_STAGES", "3e2")
    assert HBVM(k=300, s=2, h=0.1).k == 300
    with pytest.raises(InputError, match="301 stages, and the limit is 300;"):
        HBVM(k=301, s=2, h=0.1)
