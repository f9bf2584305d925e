!> The flexibility operator: tractions on the lattice -> relative surface displacements.
!>
!> The sum over all pyramids is a convolution, since the lattice is the same everywhere. w is the closing of the gap, (s_x, s_y)
!> the tangential displacement of body 1 over body 2; the bodies (hc_elastic_medium) define the blocks.
!>
!> The complete operator is symmetric (Betti) and positive definite.
!>
!> Equations: docs/theory/discretisation.md, (D4).
module hc_flexibility
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t, check_lattice
  use hc_field_space, only: field_space_t, most_threads
  use hc_elastic_medium, only: elastic_medium_t
  use hc_fftw, only: good_size, plane_time
  implicit none
  private

  public :: flexibility_t, check_operator, transform_length, padded_length, application_time, normal, along_x, along_y

  !> Components of a traction and of a relative displacement.
  integer, parameter :: normal = 1, along_x = 2, along_y = 3

  !> A flexibility operator over the nodes of a window.
  type, abstract :: flexibility_t
    !> Lattice and window
    type(lattice_t) :: lattice
    !> The two bodies
    class(elastic_medium_t), allocatable :: medium
    !> Space of the fields, of which each rank holds its own rows
    type(field_space_t) :: space
    !> Products so far, in full 3x3 applications: every component that acts or is wanted counts 1/6
    real(wp) :: applications = 0.0_wp
  contains
    !> Relative displacements of given tractions
    procedure(apply), deferred :: apply
    !> Tractions replaced by the relative displacements that they cause, and memory that the operator has for them
    procedure :: replace, in_place
    !> Do the arrays fit the window and the components?
    procedure :: check
    !> Add one product to the count
    procedure :: count => count_application
  end type flexibility_t

  abstract interface
    !> Compute displacement(:, :, o) = sum over i of block(onto(o), from(i)) * traction(:, :, i)
    subroutine apply(self, from, traction, onto, displacement, error)
      import :: flexibility_t, wp, error_t
      class(flexibility_t), intent(inout) :: self
      !> Components that act: normal, along_x, along_y
      integer, intent(in) :: from(:)
      !> Their values (n_col, n_row, size(from)) [Pa]
      real(wp), intent(in), contiguous :: traction(:, :, :)
      !> Components that are wanted
      integer, intent(in) :: onto(:)
      !> Their values (n_col, n_row, size(onto)) [m]
      real(wp), intent(out), contiguous :: displacement(:, :, :)
      !> Allocated on failure: the shapes do not fit the window
      type(error_t), allocatable, intent(out) :: error
    end subroutine apply
  end interface

contains

  !> Refuse a lattice, elastic constants and a number of threads that no operator can be made with.
  pure subroutine check_operator(lattice, medium, error, n_threads)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; 0: the default of OpenMP
    integer, intent(in), optional :: n_threads

    call check_lattice(lattice, error)
    if (allocated(error)) return
    call medium%check(error)
    if (allocated(error) .or. .not. present(n_threads)) return
    if (n_threads < 0 .or. n_threads > most_threads) then
      call raise(error, status%invalid_input, 'the number of threads: 0 (as many as OpenMP would take) to 1024 expected')
    end if
  end subroutine check_operator

  !> Return the lengths of transforms over a window: its own where it repeats, else with room for the wrap-around.
  pure function transform_length(lattice) result(length)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    integer :: length(2)

    length = padded_length(lattice%extent, lattice%is_periodic())
  end function transform_length

  !> Return the same of the size of a window.
  pure function padded_length(extent, periodic) result(length)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> It repeats; absent: it does not
    logical, intent(in), optional :: periodic
    integer :: length(2)

    length = good_size(2*extent - 1)
    if (present(periodic)) then
      if (periodic) length = extent
    end if
  end function padded_length

  !> Estimate the time of an application, in that of a transform of a point.
  pure real(wp) function application_time(lattice)
    type(lattice_t), intent(in) :: lattice
    application_time = plane_time(transform_length(lattice))
  end function application_time

  !> Replace tractions by the displacements along the same components that they cause together; by default with a copy.
  subroutine replace(self, components, values, error)
    class(flexibility_t), intent(inout) :: self
    !> Components that act and are wanted: normal, along_x, along_y
    integer, intent(in) :: components(:)
    !> Their tractions [Pa], then the displacements [m] (n_col, n_row, size(components))
    real(wp), intent(inout), contiguous :: values(:, :, :)
    !> Allocated on failure: the shapes do not fit the window
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: traction(:, :, :)

    allocate (traction, source=values)
    call self%apply(components, traction, components, values, error)
  end subroutine replace

  !> Point to memory for components as vectors, of which the next use of operators and preconditioners makes something else; by
  !> default there is none.
  function in_place(self, n_component) result(values)
    class(flexibility_t), intent(in) :: self
    !> Number of components
    integer, intent(in) :: n_component
    real(wp), pointer, contiguous :: values(:)

    values => null()
  end function in_place

  !> Refuse arrays that do not fit the window and the components.
  subroutine check(self, from, traction, onto, displacement, error)
    class(flexibility_t), intent(in) :: self
    !> Components that act, and that are wanted
    integer, intent(in) :: from(:), onto(:)
    !> Their values
    real(wp), intent(in) :: traction(:, :, :), displacement(:, :, :)
    !> Allocated if they do not fit
    type(error_t), allocatable, intent(out) :: error

    integer :: extent(2)

    extent = self%space%own_extent(self%lattice%extent)
    if (any(shape(traction) /= [extent, size(from)]) .or. any(shape(displacement) /= [extent, size(onto)])) then
      call raise(error, status%invalid_input, 'the arrays do not have the shape of the lattice window')
    end if
  end subroutine check

  !> Add one product to the count.
  subroutine count_application(self, from, onto)
    class(flexibility_t), intent(inout) :: self
    !> Components that acted, and that were wanted
    integer, intent(in) :: from(:), onto(:)

    self%applications = self%applications + (size(from) + size(onto))/6.0_wp
  end subroutine count_application

end module hc_flexibility
